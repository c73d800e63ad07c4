// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_runtime/onnx_runtime.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <numeric>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "policy_host/onnx_runtime/stored_numbers.hpp"

namespace takt::onnx_runtime {

namespace {

// The functions used, by their place in the library's table. New functions are only ever added behind the old ones, so
// that these places are the same in every version (onnxruntime_c_api.h, struct OrtApi).
enum class Place : std::size_t {
  get_error_message = 2,
  create_env = 3,
  create_session = 7,
  run = 9,
  create_session_options = 10,
  set_intra_op_threads = 24,
  set_inter_op_threads = 25,
  input_count = 30,
  output_count = 31,
  input_type = 33,
  output_type = 34,
  input_name = 36,
  output_name = 37,
  create_tensor_with_data = 49,
  tensor_of_type = 55,
  element_type = 60,
  dimension_count = 61,
  dimensions = 62,
  create_cpu_memory_info = 69,
  allocator_free = 76,
  default_allocator = 78,
  release_env = 92,
  release_status = 93,
  release_memory_info = 94,
  release_session = 95,
  release_value = 96,
  release_type = 98,
  release_session_options = 100,
};

using Table = void* const*;
using Status = void*;  // null: fine

struct Base {
  Table (*table)(std::uint32_t version) noexcept;
  const char* (*version)() noexcept;
};

// Beside the table: libraries that have the provider export it (cuda_provider_factory.h, tensorrt_provider_factory.h).
struct Provider {
  std::string_view name;
  const char* append;
};
constexpr std::array kProviders{Provider{"cuda", "OrtSessionOptionsAppendExecutionProvider_CUDA"},
                                Provider{"tensorrt", "OrtSessionOptionsAppendExecutionProvider_Tensorrt"}};

constexpr std::uint32_t kFirstVersion = 1;
constexpr int kFatalOnly = 4;  // what goes wrong is returned too, in one line
constexpr int kArenaAllocator = 1;
constexpr int kDefaultMemory = 0;

}  // namespace

class Library {
 public:
  Library(const Base* base, Table table) : base_(base), table_(table) {}
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library() {
    release(Place::release_memory_info, memory);
    release(Place::release_session_options, options);
    release(Place::release_env, environment);
    // The library keeps threads and thread-local state: it stays loaded.
  }

  std::string version() const { return base_->version(); }

  template <class... Parameters, class... Arguments>
  std::expected<void, std::string> call(Place place, Arguments... arguments) const {
    const auto function = reinterpret_cast<Status (*)(Parameters...)>(table_[static_cast<std::size_t>(place)]);
    const Status status = function(arguments...);
    if (status == nullptr) return {};
    return std::unexpected(take_message(status));
  }

  void release(Place place, void* object) const noexcept {
    if (object != nullptr) reinterpret_cast<void (*)(void*)>(table_[static_cast<std::size_t>(place)])(object);
  }

  std::expected<void, std::string> set_up(int threads) {
    auto done = call<int, const char*, void**>(Place::create_env, kFatalOnly, "takt", &environment);
    if (done) done = call<void**>(Place::create_session_options, &options);
    if (done) done = call<void*, int>(Place::set_intra_op_threads, options, threads);
    if (done) done = call<void*, int>(Place::set_inter_op_threads, options, 1);
    if (done) done = call<int, int, void**>(Place::create_cpu_memory_info, kArenaAllocator, kDefaultMemory, &memory);
    if (done) done = call<void**>(Place::default_allocator, &allocator);
    return done;
  }

  // `append`: the function of the library that adds the provider to options, by their first device.
  std::expected<void, std::string> use_provider(void* append) const {
    const Status status = reinterpret_cast<Status (*)(void*, int)>(append)(options, 0);
    return status == nullptr ? std::expected<void, std::string>{} : std::unexpected(take_message(status));
  }

  std::expected<void*, std::string> open_session(const std::filesystem::path& model) const {
    void* session = nullptr;
    const auto made =
        call<void*, const char*, void*, void**>(Place::create_session, environment, model.c_str(), options, &session);
    if (!made) return std::unexpected(made.error());
    return session;
  }

  // Inputs or outputs of a session, as `places` says.
  struct Listing {
    Place count, name, type;
  };
  struct Listed {
    std::vector<Tensor> tensors;
    std::vector<int> elements;  // their types
  };
  std::expected<Listed, std::string> list(void* session, const Listing& places) const {
    std::size_t count = 0;
    if (const auto done = call<void*, std::size_t*>(places.count, session, &count); !done)
      return std::unexpected(done.error());
    Listed listed;
    for (std::size_t i = 0; i < count; ++i) {
      auto described = describe(session, i, places);
      if (!described) return std::unexpected(described.error());
      listed.tensors.push_back(std::move(described->tensor));
      listed.elements.push_back(described->element);
    }
    return listed;
  }

  void* environment = nullptr;
  void* options = nullptr;
  void* memory = nullptr;
  void* allocator = nullptr;  // the library's own: never released here

 private:
  std::string take_message(Status status) const {
    const auto message =
        reinterpret_cast<const char* (*)(Status)>(table_[static_cast<std::size_t>(Place::get_error_message)]);
    std::string said = message(status);
    release(Place::release_status, status);
    for (char& c : said) c = c == '\n' ? ' ' : c;
    return "ONNX Runtime: " + said;
  }

  struct Described {
    Tensor tensor;
    int element = 0;
  };
  std::expected<Described, std::string> describe(void* session, std::size_t index, const Listing& places) const {
    Described described;
    Tensor& tensor = described.tensor;
    char* name = nullptr;
    auto done = call<void*, std::size_t, void*, char**>(places.name, session, index, allocator, &name);
    if (!done) return std::unexpected(done.error());
    tensor.name = name;
    (void)call<void*, void*>(Place::allocator_free, allocator, name);
    void* type = nullptr;
    done = call<void*, std::size_t, void**>(places.type, session, index, &type);
    if (done) done = read_shape(type, described);
    release(Place::release_type, type);
    if (!done) return std::unexpected(done.error());
    return described;
  }

  std::expected<void, std::string> read_shape(void* type, Described& described) const {
    Tensor& tensor = described.tensor;
    int& element = described.element;
    const void* shape = nullptr;  // of `type`
    std::size_t rank = 0;
    auto done = call<void*, const void**>(Place::tensor_of_type, type, &shape);
    if (done && shape == nullptr) return std::unexpected(tensor.name + " is no tensor");
    if (done) done = call<const void*, int*>(Place::element_type, shape, &element);
    if (done) done = call<const void*, std::size_t*>(Place::dimension_count, shape, &rank);
    if (!done) return done;
    tensor.shape.resize(rank);
    return call<const void*, std::int64_t*, std::size_t>(Place::dimensions, shape, tensor.shape.data(), rank);
  }

  const Base* base_;
  Table table_;
};

namespace {

// A tensor that the model has in another type than float32, as the library has it.
struct Stored {
  std::size_t tensor;
  int element;
  std::vector<std::byte> bytes;
};

std::size_t element_count(const Tensor& tensor) {
  return static_cast<std::size_t>(
      std::accumulate(tensor.shape.begin(), tensor.shape.end(), std::int64_t{1}, std::multiplies<>()));
}

std::expected<void, std::string> settle_batch(std::vector<Tensor>& tensors) {
  for (Tensor& tensor : tensors) {
    for (std::size_t d = 0; d < tensor.shape.size(); ++d) {
      if (tensor.shape[d] > 0) continue;
      if (d != 0)
        return std::unexpected(fmt::format("{} has an open dimension {}: export it with a fixed size", tensor.name, d));
      tensor.shape[d] = 1;
    }
  }
  return {};
}

}  // namespace

struct Session::Parts {
  std::shared_ptr<Library> library;
  void* session = nullptr;
  std::vector<Tensor> inputs, outputs;
  std::vector<Stored> stored_inputs, stored_outputs;
  std::vector<const char*> input_names, output_names;
  std::vector<void*> input_values, output_values;

  ~Parts() {
    for (void* value : input_values) library->release(Place::release_value, value);
    for (void* value : output_values) library->release(Place::release_value, value);
    library->release(Place::release_session, session);
  }

  // `elements`: their types.
  std::expected<void, std::string> bind_inputs(std::span<const int> elements) {
    return bind(inputs, elements, stored_inputs, input_names, input_values);
  }
  std::expected<void, std::string> bind_outputs(std::span<const int> elements) {
    return bind(outputs, elements, stored_outputs, output_names, output_values);
  }

 private:
  std::expected<void, std::string> bind(std::vector<Tensor>& tensors, std::span<const int> elements,
                                        std::vector<Stored>& stored, std::vector<const char*>& names,
                                        std::vector<void*>& values) const {
    for (std::size_t i = 0; i < tensors.size(); ++i) {
      Tensor& tensor = tensors[i];
      tensor.values.assign(element_count(tensor), 0.0F);
      names.push_back(tensor.name.c_str());
      values.push_back(nullptr);
      void* data = tensor.values.data();
      const std::size_t bytes = tensor.values.size() * stored_bytes(elements[i]);
      if (stored_bytes(elements[i]) == 0) return std::unexpected(tensor.name + " holds something else than numbers");
      if (elements[i] != kFloat32)
        data = stored.emplace_back(Stored{i, elements[i], std::vector<std::byte>(bytes)}).bytes.data();
      if (const auto made = make_value(tensor, data, bytes, elements[i], values.back()); !made) return made;
    }
    return {};
  }

  std::expected<void, std::string> make_value(const Tensor& tensor, void* data, std::size_t bytes, int element,
                                              void*& value) const {
    return library->call<void*, void*, std::size_t, const std::int64_t*, std::size_t, int, void**>(
        Place::create_tensor_with_data, library->memory, data, bytes, tensor.shape.data(), tensor.shape.size(), element,
        &value);
  }
};

Session::Session(std::unique_ptr<Parts> parts) noexcept : parts_(std::move(parts)) {}
Session::Session(Session&&) noexcept = default;
Session::~Session() = default;

std::span<Tensor> Session::inputs() noexcept {
  return parts_->inputs;
}
std::span<Tensor> Session::outputs() noexcept {
  return parts_->outputs;
}

std::expected<void, std::string> Session::run() {
  for (Stored& stored : parts_->stored_inputs) {
    const Tensor& input = parts_->inputs[stored.tensor];
    if (!store(input.values, stored.element, stored.bytes))
      return std::unexpected(input.name + " holds NaN, or a number that its type in the model does not");
  }
  auto ran =
      parts_->library
          ->call<void*, void*, const char* const*, void* const*, std::size_t, const char* const*, std::size_t, void**>(
              Place::run, parts_->session, nullptr, parts_->input_names.data(), parts_->input_values.data(),
              parts_->input_values.size(), parts_->output_names.data(), parts_->output_values.size(),
              parts_->output_values.data());
  for (const Stored& stored : parts_->stored_outputs)
    read(stored.bytes, stored.element, parts_->outputs[stored.tensor].values);
  return ran;
}

OnnxRuntime::OnnxRuntime(std::shared_ptr<Library> library) : library_(std::move(library)) {}
OnnxRuntime::OnnxRuntime(OnnxRuntime&&) noexcept = default;
OnnxRuntime::~OnnxRuntime() = default;

std::expected<OnnxRuntime, std::string> OnnxRuntime::open(const std::filesystem::path& library,
                                                          const SessionOptions& options) {
  const std::filesystem::path path = library.has_parent_path() ? std::filesystem::absolute(library) : library;
  void* handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) return std::unexpected(fmt::format("{}: cannot be loaded: {}", library.string(), dlerror()));
  const auto entry = reinterpret_cast<const Base* (*)()>(dlsym(handle, "OrtGetApiBase"));
  const Base* base = entry == nullptr ? nullptr : entry();
  const Table table = base == nullptr ? nullptr : base->table(kFirstVersion);
  if (table == nullptr) {
    dlclose(handle);
    return std::unexpected(fmt::format("{}: is not ONNX Runtime; name its libonnxruntime.so", library.string()));
  }
  auto opened = std::make_shared<Library>(base, table);
  if (const auto ready = opened->set_up(options.threads); !ready) return std::unexpected(ready.error());
  for (const Provider& provider : kProviders) {
    if (provider.name != options.provider) continue;
    void* const append = dlsym(handle, provider.append);
    const auto used = append == nullptr ? std::expected<void, std::string>(std::unexpected("it was built without"))
                                        : opened->use_provider(append);
    if (!used)
      return std::unexpected(fmt::format("{}: has no provider {} here ({}); take a library that has, or provider: cpu",
                                         library.string(), provider.name, used.error()));
  }
  return OnnxRuntime(std::move(opened));
}

std::string OnnxRuntime::version() const {
  return library_->version();
}

namespace {

constexpr Library::Listing kInputs{Place::input_count, Place::input_name, Place::input_type};
constexpr Library::Listing kOutputs{Place::output_count, Place::output_name, Place::output_type};

// Of `tensors`, in their order; float32 where the model has none of that name.
std::vector<int> elements_of(const Library::Listed& listed, const std::vector<Tensor>& tensors) {
  std::vector<int> elements;
  for (const Tensor& tensor : tensors) {
    const auto found = std::ranges::find(listed.tensors, tensor.name, &Tensor::name);
    elements.push_back(found == listed.tensors.end()
                           ? kFloat32
                           : listed.elements[static_cast<std::size_t>(found - listed.tensors.begin())]);
  }
  return elements;
}

}  // namespace

std::expected<Session, std::string> OnnxRuntime::load(const std::filesystem::path& model, std::vector<Tensor> inputs,
                                                      std::vector<Tensor> outputs) const {
  return load_session(model, std::pair(std::move(inputs), std::move(outputs)));
}

std::expected<Session, std::string> OnnxRuntime::load(const std::filesystem::path& model) const {
  return load_session(model, std::nullopt);
}

std::expected<Session, std::string> OnnxRuntime::load_session(
    const std::filesystem::path& model, std::optional<std::pair<std::vector<Tensor>, std::vector<Tensor>>> said) const {
  auto parts = std::make_unique<Session::Parts>();
  parts->library = library_;
  const auto session = library_->open_session(model);
  if (!session) return std::unexpected(session.error());
  parts->session = *session;
  const auto inputs = library_->list(parts->session, kInputs);
  if (!inputs) return std::unexpected(inputs.error());
  const auto outputs = library_->list(parts->session, kOutputs);
  if (!outputs) return std::unexpected(outputs.error());
  if (said) {
    std::tie(parts->inputs, parts->outputs) = *std::move(said);
  } else {
    parts->inputs = inputs->tensors;
    parts->outputs = outputs->tensors;
    for (std::vector<Tensor>* const tensors : {&parts->inputs, &parts->outputs})
      if (const auto settled = settle_batch(*tensors); !settled) return std::unexpected(settled.error());
  }
  auto done = parts->bind_inputs(elements_of(*inputs, parts->inputs));
  if (done) done = parts->bind_outputs(elements_of(*outputs, parts->outputs));
  if (!done) return std::unexpected(done.error());
  return Session(std::move(parts));
}

}  // namespace takt::onnx_runtime
