#include "policy_host/onnx_runtime_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;
using onnx_runtime::Tensor;

class OnnxRuntimePolicy final : public Policy {
 public:
  OnnxRuntimePolicy(onnx_runtime::OnnxRuntime runtime, onnx_runtime::Session session, PolicyTensors tensors)
      : runtime_(std::move(runtime)), session_(std::move(session)), tensors_(std::move(tensors)) {
    for (const std::size_t input : tensors_.observation) input_size_ += session_.inputs()[input].values.size();
    output_size_ = session_.outputs()[tensors_.actions].values.size();
  }

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  [[nodiscard]] bool is_recurrent() const override { return !tensors_.states.empty() || tensors_.time_step; }

  void infer(std::span<const float> input, std::span<float> output) override {
    const std::span<Tensor> in = session_.inputs(), out = session_.outputs();
    for (const std::size_t part : tensors_.observation) {
      std::vector<float>& to = in[part].values;
      std::ranges::copy(input.first(to.size()), to.begin());
      input = input.subspan(to.size());
    }
    if (tensors_.time_step) in[*tensors_.time_step].values[0] = static_cast<float>(step_++);
    if (const auto ran = session_.run(); !ran) throw std::runtime_error(ran.error());
    std::ranges::copy(out[tensors_.actions].values, output.begin());
    for (const PolicyTensors::State& state : tensors_.states)
      std::ranges::copy(out[state.output].values, in[state.input].values.begin());
  }

  void reset() override {
    step_ = 0;
    for (const PolicyTensors::State& state : tensors_.states)
      std::ranges::fill(session_.inputs()[state.input].values, 0.0F);
  }

 private:
  onnx_runtime::OnnxRuntime runtime_;  // outlives the session
  onnx_runtime::Session session_;
  PolicyTensors tensors_;
  std::size_t input_size_ = 0, output_size_ = 0;
  std::uint64_t step_ = 0;
};

std::vector<TensorInfo> infos_of(std::span<const Tensor> tensors) {
  std::vector<TensorInfo> infos;
  for (const Tensor& tensor : tensors) infos.push_back({tensor.name, tensor.shape});
  return infos;
}

}  // namespace

std::expected<std::unique_ptr<Policy>, std::string> load_onnx_runtime_policy(onnx_runtime::OnnxRuntime runtime,
                                                                             const std::string& file,
                                                                             const std::string& input,
                                                                             const std::string& output) {
  auto session = runtime.load(file);
  if (!session) return std::unexpected(fmt::format("{}: {}", file, session.error()));
  const std::vector<TensorInfo> inputs = infos_of(session->inputs()), outputs = infos_of(session->outputs());
  auto tensors = assign_tensors({inputs, outputs}, file, input, output);
  if (!tensors) return std::unexpected(tensors.error());
  if (const auto ran = session->run(); !ran) return std::unexpected(fmt::format("{}: {}", file, ran.error()));
  return std::make_unique<OnnxRuntimePolicy>(std::move(runtime), *std::move(session), *std::move(tensors));
}

}  // namespace takt::policy_host
