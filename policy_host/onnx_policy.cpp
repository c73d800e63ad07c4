#include "policy_host/onnx_policy.hpp"

#include <algorithm>
#include <utility>

#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/onnx/model.hpp"

namespace takt::policy_host {
namespace {

class OnnxPolicy final : public Policy {
 public:
  OnnxPolicy(onnx_engine::Model model, PolicyTensors tensors) : model_(std::move(model)), tensors_(std::move(tensors)) {
    for (const std::size_t input : tensors_.observation) input_size_ += model_.input(input).size();
    output_size_ = model_.output(tensors_.actions).size();
  }

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  [[nodiscard]] bool is_recurrent() const override { return !tensors_.states.empty() || tensors_.time_step; }
  [[nodiscard]] std::string description() const override { return "built-in engine"; }
  [[nodiscard]] bool is_built_in() const override { return true; }

  void infer(std::span<const float> input, std::span<float> output) override {
    for (const std::size_t part : tensors_.observation) {
      const std::span<float> to = model_.input(part);
      std::ranges::copy(input.first(to.size()), to.begin());
      input = input.subspan(to.size());
    }
    if (tensors_.time_step) model_.input(*tensors_.time_step)[0] = static_cast<float>(step_++);
    model_.run();
    std::ranges::copy(model_.output(tensors_.actions), output.begin());
    for (const PolicyTensors::State& state : tensors_.states) {
      std::ranges::copy(model_.output(state.output), model_.input(state.input).begin());
    }
  }

  void reset() override {
    step_ = 0;
    for (const PolicyTensors::State& state : tensors_.states) std::ranges::fill(model_.input(state.input), 0.0F);
  }

 private:
  onnx_engine::Model model_;
  PolicyTensors tensors_;
  std::size_t input_size_ = 0, output_size_ = 0;
  std::uint64_t step_ = 0;
};

}  // namespace

ModelTensors tensors_of(const onnx_engine::Model& model) {
  return {model.inputs(), model.outputs(), model.lost_states()};
}

std::expected<std::unique_ptr<Policy>, std::string> make_onnx_policy(onnx_engine::Model model, const std::string& file,
                                                                     const std::string& input,
                                                                     const std::string& output) {
  auto tensors = assign_tensors(tensors_of(model), file, input, output);
  if (!tensors) return std::unexpected(tensors.error());
  return std::make_unique<OnnxPolicy>(std::move(model), *std::move(tensors));
}

std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output) {
  auto model = onnx_engine::load(file);
  if (!model) return std::unexpected(model.error());
  return make_onnx_policy(*std::move(model), file, input, output);
}

std::expected<std::unique_ptr<Policy>, std::string> load_robot_policy(const config::RobotConfig& robot) {
  const config::Policy& section = *robot.policy;
  auto network = load_onnx_policy(section.file, network_input(section), section.output);
  if (!network) return network;
  return with_sampler(robot, *std::move(network));
}

}  // namespace takt::policy_host
