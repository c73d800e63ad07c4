// SPDX-License-Identifier: Apache-2.0
#include "policy_host/engines/engine_network.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "policy_host/engines/plugin.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;

class PluginNetwork final : public Network {
 public:
  PluginNetwork(EngineNetwork network, std::vector<TensorInfo> inputs, std::vector<TensorInfo> outputs,
                FileReading reading)
      : network_(std::move(network)),
        inputs_(std::move(inputs)),
        outputs_(std::move(outputs)),
        reading_(std::move(reading)) {
    if (network_.keeps_state()) reading_ = {};
  }

  [[nodiscard]] std::span<const TensorInfo> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const TensorInfo> outputs() const override { return outputs_; }
  [[nodiscard]] std::span<const std::string> lost_states() const override { return reading_.lost_states; }
  [[nodiscard]] std::string description() const override {
    return reading_.note.empty() ? network_.description() : network_.description() + "; " + reading_.note;
  }
  [[nodiscard]] bool keeps_state() const override { return network_.keeps_state(); }
  void forget() override { network_.reset(); }
  std::span<float> input(std::size_t i) override {
    const takt_engine_tensor& tensor = network_.inputs()[i];
    return {tensor.values, value_count(tensor)};
  }
  [[nodiscard]] std::span<const float> output(std::size_t i) const override {
    const takt_engine_tensor& tensor = network_.outputs()[i];
    return {tensor.values, value_count(tensor)};
  }
  void run() override {
    if (const auto ran = network_.infer(); !ran) throw std::runtime_error(ran.error());
  }

 private:
  EngineNetwork network_;
  std::vector<TensorInfo> inputs_, outputs_;
  FileReading reading_;
};

std::vector<TensorInfo> infos_of(std::span<const takt_engine_tensor> tensors) {
  std::vector<TensorInfo> infos;
  for (const takt_engine_tensor& tensor : tensors)
    infos.push_back({tensor.name, {tensor.shape, tensor.shape + tensor.rank}});
  return infos;
}

// Names for outputs that have none, by their order. The error says what is left over.
std::expected<void, std::string> name_by_order(std::span<const TensorInfo> inputs, std::vector<TensorInfo>& outputs,
                                               const std::string& actions, const std::string& file) {
  std::vector<std::string> fed;
  for (const TensorInfo& input : inputs)
    if (std::string name = name_of_next_state(input.name); !name.empty()) fed.push_back(std::move(name));
  if (outputs.size() > fed.size() + 1)
    return std::unexpected(
        fmt::format("{}: returns {} tensors, and {} of its arguments are hidden state by their names; return the "
                    "actions first, then the state, and call each state argument <x>_in",
                    file, outputs.size(), fed.size()));
  outputs.front().name = actions.empty() ? "actions" : actions;
  for (std::size_t i = 1; i < outputs.size(); ++i) outputs[i].name = fed[i - 1];
  return {};
}

}  // namespace

std::expected<std::unique_ptr<Network>, std::string> load_engine_network(const std::string& plugin,
                                                                         const config::RobotConfig& robot,
                                                                         const std::filesystem::path& file,
                                                                         FileReading reading) {
  auto network = open_network(plugin, robot, file);
  if (!network) return std::unexpected(network.error());
  std::vector<TensorInfo> inputs = infos_of(network->inputs());
  std::vector<TensorInfo> outputs = infos_of(network->outputs());
  if (std::ranges::all_of(outputs, [](const TensorInfo& output) { return output.name.empty(); }))
    if (const auto named = name_by_order(inputs, outputs, robot.policy->output, file.string()); !named)
      return std::unexpected(named.error());
  return std::make_unique<PluginNetwork>(*std::move(network), std::move(inputs), std::move(outputs),
                                         std::move(reading));
}

}  // namespace takt::policy_host
