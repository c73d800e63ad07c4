#include "policy_host/onnx_runtime/onnx_runtime.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <array>
#include <functional>
#include <numeric>
#include <string_view>
#include <utility>

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
constexpr int kFloat = 1;
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
  std::expected<std::vector<Tensor>, std::string> list(void* session, const Listing& places) const {
    std::size_t count = 0;
    if (const auto done = call<void*, std::size_t*>(places.count, session, &count); !done)
      return std::unexpected(done.error());
    std::vector<Tensor> tensors;
    for (std::size_t i = 0; i < count; ++i) {
      auto tensor = describe(session, i, places);
      if (!tensor) return std::unexpected(tensor.error());
      tensors.push_back(*std::move(tensor));
    }
    return tensors;
  }

  void* environment = nullptr;
  void* options = nullptr;
  void* memory = nullptr;
  void* allocator = nullptr;  // the library's own: nobody releases it

 private:
  std::string take_message(Status status) const {
    const auto message =
        reinterpret_cast<const char* (*)(Status)>(table_[static_cast<std::size_t>(Place::get_error_message)]);
    std::string said = message(status);
    release(Place::release_status, status);
    for (char& c : said) c = c == '\n' ? ' ' : c;
    return "ONNX Runtime: " + said;
  }

  std::expected<Tensor, std::string> describe(void* session, std::size_t index, const Listing& places) const {
    Tensor tensor;
    char* name = nullptr;
    auto done = call<void*, std::size_t, void*, char**>(places.name, session, index, allocator, &name);
    if (!done) return std::unexpected(done.error());
    tensor.name = name;
    (void)call<void*, void*>(Place::allocator_free, allocator, name);
    void* type = nullptr;
    done = call<void*, std::size_t, void**>(places.type, session, index, &type);
    if (done) done = read_shape(type, tensor);
    release(Place::release_type, type);
    if (!done) return std::unexpected(done.error());
    return tensor;
  }

  std::expected<void, std::string> read_shape(void* type, Tensor& tensor) const {
    const void* shape = nullptr;  // of `type`
    int element = 0;
    std::size_t rank = 0;
    auto done = call<void*, const void**>(Place::tensor_of_type, type, &shape);
    if (done && shape == nullptr) return std::unexpected(tensor.name + " is no tensor");
    if (done) done = call<const void*, int*>(Place::element_type, shape, &element);
    if (done) done = call<const void*, std::size_t*>(Place::dimension_count, shape, &rank);
    if (!done) return done;
    if (element != kFloat) return std::unexpected(tensor.name + " is not float32, the only kind supported");
    tensor.shape.resize(rank);
    done = call<const void*, std::int64_t*, std::size_t>(Place::dimensions, shape, tensor.shape.data(), rank);
    if (!done) return done;
    for (std::size_t d = 0; d < rank; ++d) {
      if (tensor.shape[d] > 0) continue;
      if (d != 0)
        return std::unexpected(fmt::format("{} has an open dimension {}: export it with a fixed size", tensor.name, d));
      tensor.shape[d] = 1;
    }
    return {};
  }

  const Base* base_;
  Table table_;
};

struct Session::Parts {
  std::shared_ptr<Library> library;
  void* session = nullptr;
  std::vector<Tensor> inputs, outputs;
  std::vector<const char*> input_names, output_names;
  std::vector<void*> input_values, output_values;

  ~Parts() {
    for (void* value : input_values) library->release(Place::release_value, value);
    for (void* value : output_values) library->release(Place::release_value, value);
    library->release(Place::release_session, session);
  }

  std::expected<void, std::string> bind(std::vector<Tensor>& tensors, std::vector<const char*>& names,
                                        std::vector<void*>& values) const {
    for (Tensor& tensor : tensors) {
      const std::int64_t count =
          std::accumulate(tensor.shape.begin(), tensor.shape.end(), std::int64_t{1}, std::multiplies<>());
      tensor.values.assign(static_cast<std::size_t>(count), 0.0F);
      names.push_back(tensor.name.c_str());
      values.push_back(nullptr);
      const auto made = library->call<void*, void*, std::size_t, const std::int64_t*, std::size_t, int, void**>(
          Place::create_tensor_with_data, library->memory, tensor.values.data(), tensor.values.size() * sizeof(float),
          tensor.shape.data(), tensor.shape.size(), kFloat, &values.back());
      if (!made) return made;
    }
    return {};
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
  return parts_->library
      ->call<void*, void*, const char* const*, void* const*, std::size_t, const char* const*, std::size_t, void**>(
          Place::run, parts_->session, nullptr, parts_->input_names.data(), parts_->input_values.data(),
          parts_->input_values.size(), parts_->output_names.data(), parts_->output_values.size(),
          parts_->output_values.data());
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

std::expected<Session, std::string> OnnxRuntime::load(const std::filesystem::path& model, std::vector<Tensor> inputs,
                                                      std::vector<Tensor> outputs) const {
  auto parts = std::make_unique<Session::Parts>();
  parts->library = library_;
  const auto session = library_->open_session(model);
  if (!session) return std::unexpected(session.error());
  parts->session = *session;
  parts->inputs = std::move(inputs);
  parts->outputs = std::move(outputs);
  return bound(std::move(parts));
}

std::expected<Session, std::string> OnnxRuntime::load(const std::filesystem::path& model) const {
  auto parts = std::make_unique<Session::Parts>();
  parts->library = library_;
  const auto session = library_->open_session(model);
  if (!session) return std::unexpected(session.error());
  parts->session = *session;
  auto inputs = library_->list(parts->session, {Place::input_count, Place::input_name, Place::input_type});
  if (!inputs) return std::unexpected(inputs.error());
  auto outputs = library_->list(parts->session, {Place::output_count, Place::output_name, Place::output_type});
  if (!outputs) return std::unexpected(outputs.error());
  parts->inputs = *std::move(inputs);
  parts->outputs = *std::move(outputs);
  return bound(std::move(parts));
}

std::expected<Session, std::string> OnnxRuntime::bound(std::unique_ptr<Session::Parts> parts) {
  auto done = parts->bind(parts->inputs, parts->input_names, parts->input_values);
  if (done) done = parts->bind(parts->outputs, parts->output_names, parts->output_values);
  if (!done) return std::unexpected(done.error());
  return Session(std::move(parts));
}

}  // namespace takt::onnx_runtime
