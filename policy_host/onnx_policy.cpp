// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_policy.hpp"

#include <utility>

#include "policy_host/assemble_policy.hpp"

namespace takt::policy_host {
namespace {

class OnnxNetwork final : public Network {
 public:
  explicit OnnxNetwork(onnx_engine::Model model) : model_(std::move(model)) {}
  [[nodiscard]] std::span<const onnx_engine::TensorInfo> inputs() const override { return model_.inputs(); }
  [[nodiscard]] std::span<const onnx_engine::TensorInfo> outputs() const override { return model_.outputs(); }
  [[nodiscard]] std::span<const std::string> lost_states() const override { return model_.lost_states(); }
  [[nodiscard]] bool is_built_in() const override { return true; }
  [[nodiscard]] std::string description() const override { return "built-in engine"; }
  std::span<float> input(std::size_t i) override { return model_.input(i); }
  [[nodiscard]] std::span<const float> output(std::size_t i) const override { return model_.output(i); }
  void run() override { model_.run(); }

 private:
  onnx_engine::Model model_;
};

}  // namespace

ModelTensors tensors_of(const onnx_engine::Model& model) {
  return {model.inputs(), model.outputs(), model.lost_states()};
}

std::expected<OnnxReading, std::string> read_onnx_policy(const std::filesystem::path& file, const std::string& input,
                                                         const std::string& output) {
  auto model = onnx_engine::load(file);
  if (!model) return std::unexpected(model.error());
  auto tensors = assign_tensors(tensors_of(*model), file.string(), input, output);
  if (!tensors) return std::unexpected(tensors.error());
  return OnnxReading{*std::move(model), *std::move(tensors)};
}

std::unique_ptr<Network> make_onnx_network(onnx_engine::Model model) {
  return std::make_unique<OnnxNetwork>(std::move(model));
}

std::expected<std::unique_ptr<Network>, std::string> load_onnx_network(const std::filesystem::path& file) {
  auto model = onnx_engine::load(file);
  if (!model) return std::unexpected(model.error());
  return make_onnx_network(*std::move(model));
}

std::expected<std::unique_ptr<Policy>, std::string> load_robot_policy(const config::RobotConfig& robot) {
  return assemble_policy(robot, load_onnx_network);
}

std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output) {
  return load_network_policy(file, input, output, load_onnx_network);
}

}  // namespace takt::policy_host
