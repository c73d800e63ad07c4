#include "policy_host/onnx_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "policy_host/onnx/model.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;

struct HiddenState {
  std::size_t input;
  std::size_t output;
};

class OnnxPolicy final : public Policy {
 public:
  OnnxPolicy(onnx_engine::Model model, std::size_t input, std::size_t output, std::vector<HiddenState> hidden)
      : model_(std::move(model)), input_(input), output_(output), hidden_(std::move(hidden)) {
    input_size_ = model_.input(input_).size();
    output_size_ = model_.output(output_).size();
  }

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }

  void infer(std::span<const float> input, std::span<float> output) override {
    std::ranges::copy(input, model_.input(input_).begin());
    model_.run();
    std::ranges::copy(model_.output(output_), output.begin());
    for (const HiddenState& state : hidden_) {
      std::ranges::copy(model_.output(state.output), model_.input(state.input).begin());
    }
  }

  void reset() override {
    for (const HiddenState& state : hidden_) std::ranges::fill(model_.input(state.input), 0.0F);
  }

 private:
  onnx_engine::Model model_;
  std::size_t input_, output_;
  std::vector<HiddenState> hidden_;
  std::size_t input_size_ = 0, output_size_ = 0;
};

std::optional<std::size_t> find(std::span<const TensorInfo> tensors, const std::string& name) {
  const auto found = std::ranges::find(tensors, name, &TensorInfo::name);
  if (found == tensors.end()) return std::nullopt;
  return static_cast<std::size_t>(found - tensors.begin());
}

std::string names(std::span<const TensorInfo> tensors) {
  std::string all;
  for (const TensorInfo& tensor : tensors) all += (all.empty() ? "" : ", ") + tensor.name;
  return all;
}

// The output that feeds a hidden-state input: same stem, same shape.
std::optional<HiddenState> pair_state(const onnx_engine::Model& model, std::size_t input) {
  const TensorInfo& in = model.inputs()[input];
  if (!in.name.ends_with("_in")) return std::nullopt;
  const auto output = find(model.outputs(), in.name.substr(0, in.name.size() - 3) + "_out");
  if (!output || model.outputs()[*output].shape != in.shape) return std::nullopt;
  return HiddenState{input, *output};
}

}  // namespace

std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output) {
  auto model = onnx_engine::load(file);
  if (!model) return std::unexpected(model.error());
  const auto observation = find(model->inputs(), input);
  if (!observation) {
    return std::unexpected(
        fmt::format("{}: no input named {}, it has {}; mend policy.input", file, input, names(model->inputs())));
  }
  const auto actions = find(model->outputs(), output);
  if (!actions) {
    return std::unexpected(
        fmt::format("{}: no output named {}, it has {}; mend policy.output", file, output, names(model->outputs())));
  }
  std::vector<HiddenState> hidden;
  for (std::size_t i = 0; i < model->inputs().size(); ++i) {
    if (i == *observation) continue;
    const auto state = pair_state(*model, i);
    if (!state) {
      return std::unexpected(fmt::format(
          "{}: input {} is neither the observation nor hidden state; name a hidden state <x>_in with an output <x>_out "
          "of the same shape",
          file, model->inputs()[i].name));
    }
    hidden.push_back(*state);
  }
  return std::make_unique<OnnxPolicy>(std::move(*model), *observation, *actions, std::move(hidden));
}

}  // namespace takt::policy_host
