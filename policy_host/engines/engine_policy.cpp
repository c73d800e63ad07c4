#include "policy_host/engines/engine_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;

std::span<float> values_of(const takt_engine_tensor& tensor) {
  return {tensor.values, value_count(tensor)};
}

class EnginePolicy final : public Policy {
 public:
  EnginePolicy(EngineNetwork network, PolicyTensors tensors)
      : network_(std::move(network)), tensors_(std::move(tensors)) {
    for (const std::size_t input : tensors_.observation) input_size_ += value_count(network_.inputs()[input]);
    output_size_ = value_count(network_.outputs()[tensors_.actions]);
  }

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  [[nodiscard]] bool is_recurrent() const override {
    return !tensors_.states.empty() || tensors_.time_step || network_.keeps_state();
  }
  [[nodiscard]] std::string description() const override { return network_.description(); }

  void infer(std::span<const float> input, std::span<float> output) override {
    for (const std::size_t part : tensors_.observation) {
      const std::span<float> to = values_of(network_.inputs()[part]);
      std::ranges::copy(input.first(to.size()), to.begin());
      input = input.subspan(to.size());
    }
    if (tensors_.time_step) network_.inputs()[*tensors_.time_step].values[0] = static_cast<float>(step_++);
    if (const auto ran = network_.infer(); !ran) throw std::runtime_error(ran.error());
    std::ranges::copy(values_of(network_.outputs()[tensors_.actions]), output.begin());
    for (const auto& [in, out] : tensors_.states)
      std::ranges::copy(values_of(network_.outputs()[out]), network_.inputs()[in].values);
  }

  void reset() override {
    step_ = 0;
    for (const PolicyTensors::State& state : tensors_.states)
      std::ranges::fill(values_of(network_.inputs()[state.input]), 0.0F);
    if (network_.keeps_state()) network_.reset();
  }

 private:
  EngineNetwork network_;
  PolicyTensors tensors_;
  std::size_t input_size_ = 0, output_size_ = 0;
  std::uint64_t step_ = 0;
};

std::vector<TensorInfo> infos_of(std::span<const takt_engine_tensor> tensors) {
  std::vector<TensorInfo> infos;
  for (const takt_engine_tensor& tensor : tensors)
    infos.push_back({tensor.name, {tensor.shape, tensor.shape + tensor.rank}});
  return infos;
}

// Names for outputs that have none, by their order. The error says what is left over.
std::expected<void, std::string> name_by_order(std::span<const TensorInfo> inputs, std::vector<TensorInfo>& outputs,
                                               const config::Policy& policy) {
  std::vector<std::string> fed;
  for (const TensorInfo& input : inputs)
    if (std::string name = name_of_next_state(input.name); !name.empty()) fed.push_back(std::move(name));
  if (outputs.size() > fed.size() + 1)
    return std::unexpected(
        fmt::format("{}: returns {} tensors, and {} of its arguments are hidden state by their names; return the "
                    "actions first, then the state, and call each state argument <x>_in",
                    policy.file, outputs.size(), fed.size()));
  outputs.front().name = policy.output.empty() ? "actions" : policy.output;
  for (std::size_t i = 1; i < outputs.size(); ++i) outputs[i].name = fed[i - 1];
  return {};
}

}  // namespace

std::expected<std::unique_ptr<Policy>, std::string> load_engine_policy(const std::string& plugin,
                                                                       const config::RobotConfig& robot) {
  auto network = open_network(plugin, robot);
  if (!network) return std::unexpected(network.error());
  const config::Policy& section = *robot.policy;
  const std::vector<TensorInfo> inputs = infos_of(network->inputs());
  std::vector<TensorInfo> outputs = infos_of(network->outputs());
  if (std::ranges::all_of(outputs, [](const TensorInfo& output) { return output.name.empty(); }))
    if (const auto named = name_by_order(inputs, outputs, section); !named) return std::unexpected(named.error());
  auto tensors = assign_tensors({inputs, outputs}, section.file, network_input(section), section.output);
  if (!tensors) return std::unexpected(tensors.error());
  return std::make_unique<EnginePolicy>(*std::move(network), *std::move(tensors));
}

}  // namespace takt::policy_host
