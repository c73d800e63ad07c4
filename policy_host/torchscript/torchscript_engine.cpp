// SPDX-License-Identifier: Apache-2.0
// TorchScript as a plugin (takt/engine.h), by libtorch: policies as torch.jit.save writes them.
//
// forward's arguments are the inputs, by their names; what it returns, a tensor or a tuple of them, are the outputs, in
// their order. A shape that policy.engine.shapes does not give is 1 x the observation's values, of one argument at
// most; where those are not known either, 1 x the first width of its weights that forward takes. A module that answers
// the same input differently the second time keeps state of its own: it needs a method reset() (rsl_rl's exporter) or
// reset_memory() (legged_gym's), and is reset before it is used.
#include <ATen/Parallel.h>
#include <fmt/format.h>
#include <torch/script.h>
#include <torch/version.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "policy_host/engines/tensor_list.hpp"
#include "policy_host/torchscript/linear_algebra.hpp"
#include "policy_host/torchscript/row_products.hpp"

namespace takt::torchscript {
namespace {

constexpr float kSomeValue = 0.5F;  // of an input while the module is tried out
// Of answers that are the same: libtorch fuses differently from the second run on.
constexpr double kSame = 1e-6;
constexpr double kSameOptimised = 1e-5;  // other orders of summing
constexpr int kWarmingRuns = 2;          // that profile and specialise

// A name, and memory that the host writes or reads.
struct Port {
  std::string name;
  std::vector<std::int64_t> shape;
  std::vector<float> values{};

  void take_room() {
    std::size_t count = 1;
    for (const std::int64_t dimension : shape) count *= static_cast<std::size_t>(dimension);
    values.assign(count, 0.0F);
  }
};

// libtorch's errors go on for pages: the line that says what went wrong is the first, or of an error inside the
// script the last that says anything.
std::string line_of(const std::exception& thrown) {
  const auto* const error = dynamic_cast<const c10::Error*>(&thrown);
  std::string text = error != nullptr ? error->what_without_backtrace() : thrown.what();
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  if (text.starts_with("The following operation failed in the TorchScript interpreter"))
    text = text.substr(text.rfind('\n') + 1);
  return text.substr(0, text.find('\n'));
}

torch::jit::Module load(const std::string& file) {
  try {
    return torch::jit::load(file, torch::kCPU);
  } catch (const c10::Error& error) {
    throw std::runtime_error(
        fmt::format("{}: is no TorchScript file ({}); write one with torch.jit.save, or name another policy.engine",
                    file, line_of(error)));
  }
}

class Network : public takt_engine_network {
 public:
  explicit Network(const takt_engine_setup& setup)
      : takt_engine_network{}, file_(setup.file), module_(load(setup.file)) {
    module_.eval();
    take_arguments(setup);
    try_out();
    list();
    size = sizeof(takt_engine_network);
    about_ = fmt::format("TorchScript, libtorch {}, {}, cpu, {} thread{}", TORCH_VERSION, linear_algebra(),
                         setup.threads, setup.threads == 1 ? "" : "s");
    description = about_.c_str();
  }

  void infer() {
    const c10::InferenceMode no_gradients;
    const std::vector<torch::Tensor> results = forward();
    if (results.size() != out_.size()) throw std::runtime_error(file_ + ": returns another number of tensors now");
    for (std::size_t i = 0; i < out_.size(); ++i) {
      if (!std::ranges::equal(results[i].sizes(), out_[i].shape))
        throw std::runtime_error(fmt::format("{}: its result {} has another shape now", file_, i));
      std::copy_n(results[i].data_ptr<float>(), out_[i].values.size(), out_[i].values.data());
    }
  }

  void reset() {
    const c10::InferenceMode no_gradients;
    module_.get_method(forgets_by_)({});
  }

 private:
  void take_arguments(const takt_engine_setup& setup) {
    const auto arguments = module_.get_method("forward").function().getSchema().arguments();
    bool observation_given = false;
    for (const c10::Argument& argument : std::span(arguments).subspan(1)) {  // behind `self`
      if (argument.default_value()) continue;
      if (!argument.type()->isSubtypeOf(*c10::TensorType::get()))
        throw std::runtime_error(fmt::format("{}: forward's argument {} is a {}, and only tensors are fed", file_,
                                             argument.name(), argument.type()->str()));
      Port port{argument.name(), shape_of(argument.name(), setup)};
      if (port.shape.empty()) {
        if (std::exchange(observation_given, true))
          throw std::runtime_error(
              fmt::format("{}: the file does not say what shape forward's argument {} has; add it to "
                          "policy.engine.shapes",
                          file_, port.name));
        port.shape = {1, static_cast<std::int64_t>(setup.observation_values)};
      }
      in_.push_back(std::move(port));
      in_.back().take_room();
    }
    for (const takt_engine_tensor& stated : std::span(setup.shapes, setup.shape_count))
      if (std::ranges::find(in_, stated.name, &Port::name) == in_.end())
        throw std::runtime_error(
            fmt::format("{}: forward has no argument {}; correct policy.engine.shapes", file_, stated.name));
    if (in_.empty()) throw std::runtime_error(file_ + ": forward takes no tensor");
    const auto open = std::ranges::find(in_, 0, [](const Port& port) { return port.shape.back(); });
    if (open != in_.end()) find_width(*open);
  }

  // What a layer multiplies its input with has the input's width as its last dimension.
  void find_width(Port& port) {
    const c10::InferenceMode no_gradients;
    std::vector<std::int64_t> widths;
    for (const torch::Tensor& weight : module_.parameters())
      if (weight.dim() == 2 && std::ranges::find(widths, weight.size(1)) == widths.end())
        widths.push_back(weight.size(1));
    for (const std::int64_t width : widths) {
      port.shape.back() = width;
      port.take_room();
      try {
        (void)forward();
        return;
      } catch (const std::exception&) {  // another one
      }
    }
    throw std::runtime_error(
        fmt::format("{}: takes none of the widths of its weights as its argument {}; say its shape in "
                    "policy.engine.shapes",
                    file_, port.name));
  }

  static std::vector<std::int64_t> shape_of(const std::string& name, const takt_engine_setup& setup) {
    for (const takt_engine_tensor& stated : std::span(setup.shapes, setup.shape_count))
      if (name == stated.name) return {stated.shape, stated.shape + stated.rank};
    return {};
  }

  [[nodiscard]] std::vector<torch::Tensor> forward() {
    std::vector<c10::IValue> arguments;
    for (Port& port : in_) arguments.emplace_back(torch::from_blob(port.values.data(), port.shape, torch::kFloat32));
    const c10::IValue result = module_.forward(std::move(arguments));
    std::vector<torch::Tensor> tensors;
    const auto take = [&](const c10::IValue& value) {
      if (!value.isTensor()) throw std::runtime_error(file_ + ": forward returns something besides tensors");
      tensors.push_back(value.toTensor().to(torch::kCPU, torch::kFloat32).contiguous());
    };
    if (result.isTuple())
      for (const c10::IValue& value : result.toTupleRef().elements()) take(value);
    else
      take(result);
    return tensors;
  }

  // Its outputs' shapes, and whether it remembers. Warms up likewise.
  void try_out() {
    const c10::InferenceMode no_gradients;
    for (Port& port : in_) std::ranges::fill(port.values, kSomeValue);
    const std::vector<torch::Tensor> before = answer(), again = answer();
    for (const torch::Tensor& tensor : before) {
      out_.push_back({"", {tensor.sizes().begin(), tensor.sizes().end()}});
      out_.back().take_room();
    }
    keeps_state = are_close(before, again) ? 0 : 1;
    if (keeps_state != 0)
      find_reset();
    else
      optimise(before);
    for (Port& port : in_) std::ranges::fill(port.values, 0.0F);
    (void)forward();
    if (keeps_state != 0) reset();
  }

  // Weights become constants, normalisations are folded into convolutions. A module that this does not go through with,
  // or that then says something else, stays as it was. What is kept in a module is no constant.
  void optimise(const std::vector<torch::Tensor>& before) {
    const torch::jit::Module as_loaded = module_;
    try {
      module_ = torch::jit::freeze(as_loaded);
      multiply_rows_as_vectors(module_);
      module_ = torch::jit::optimize_for_inference(module_);
      for (int i = 0; i < kWarmingRuns; ++i) (void)forward();
      if (are_close(before, answer(), kSameOptimised)) return;
    } catch (const std::exception&) {  // as it was
    }
    module_ = as_loaded;
    for (int i = 0; i < kWarmingRuns; ++i) (void)forward();
  }

  std::vector<torch::Tensor> answer() {
    std::vector<torch::Tensor> tensors;
    for (const torch::Tensor& tensor : forward()) tensors.push_back(tensor.clone());
    return tensors;
  }

  static bool are_close(const std::vector<torch::Tensor>& a, const std::vector<torch::Tensor>& b,
                        double apart = kSame) {
    return std::ranges::equal(a, b, [apart](const torch::Tensor& x, const torch::Tensor& y) {
      return x.sizes() == y.sizes() && torch::allclose(x, y, apart, apart, true);
    });
  }

  // The method after which the first answer is the first again.
  void find_reset() {
    for (const char* const name : {"reset", "reset_memory"}) {
      if (!module_.find_method(name).has_value()) continue;
      forgets_by_ = name;
      reset();
      const std::vector<torch::Tensor> first = answer();
      (void)forward();
      reset();
      if (are_close(first, answer())) return;
    }
    throw std::runtime_error(
        file_ +
        ": answers the same input differently the second time, and has no method reset() or reset_memory() that "
        "makes it forget; export it with one, or with its state as arguments <x>_in, in eval()");
  }

  void list() {
    for (Port& port : in_) listed_inputs_.push_back(engines::listed(port.name, port.shape, port.values.data()));
    for (Port& port : out_) listed_outputs_.push_back(engines::listed(port.name, port.shape, port.values.data()));
    inputs = listed_inputs_.data();
    input_count = listed_inputs_.size();
    outputs = listed_outputs_.data();
    output_count = listed_outputs_.size();
  }

  std::string file_, about_, forgets_by_;
  torch::jit::Module module_;
  std::vector<Port> in_, out_;
  std::vector<takt_engine_tensor> listed_inputs_, listed_outputs_;
};

std::string refusal_of_options(const takt_engine_setup& setup) {
  if (std::string_view(setup.provider) != "cpu")
    return fmt::format("{}: Debian's libtorch computes on the CPU only, not by {}; write provider: cpu", setup.file,
                       setup.provider);
  if (*setup.library != '\0') return "policy.engine.library: torchscript is built with its library; leave it out";
  return {};
}

takt_engine_network* open(const takt_engine_setup* setup, char* error, std::size_t error_size) {
  try {
    if (const std::string refusal = refusal_of_options(*setup); !refusal.empty()) throw std::runtime_error(refusal);
    at::set_num_threads(static_cast<int>(setup->threads));
    limit_linear_algebra(setup->threads);
    static const bool once = (at::set_num_interop_threads(1), true);
    (void)once;
    return std::make_unique<Network>(*setup).release();
  } catch (const std::exception& thrown) {
    const std::string said = line_of(thrown);
    engines::say(
        said.starts_with(setup->file) || said.starts_with("policy.") ? said : fmt::format("{}: {}", setup->file, said),
        error, error_size);
  }
  return nullptr;
}

int infer(takt_engine_network* network, char* error, std::size_t error_size) {
  try {
    static_cast<Network*>(network)->infer();
    return 0;
  } catch (const std::exception& thrown) {
    engines::say(line_of(thrown), error, error_size);
  }
  return 1;
}

void reset(takt_engine_network* network) {
  static_cast<Network*>(network)->reset();
}

void close(takt_engine_network* network) {
  delete static_cast<Network*>(network);  // NOLINT(cppcoreguidelines-owning-memory): made by open()
}

constexpr takt_engine_table kEngine{TAKT_ENGINE_ABI, sizeof(takt_engine_table), open, infer, reset, close};

}  // namespace
}  // namespace takt::torchscript

const takt_engine_table* takt_engine() {
  return &takt::torchscript::kEngine;
}
