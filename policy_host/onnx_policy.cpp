#include "policy_host/onnx_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "policy_host/onnx/model.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;

class OnnxPolicy final : public Policy {
 public:
  OnnxPolicy(onnx_engine::Model model, PolicyTensors tensors) : model_(std::move(model)), tensors_(std::move(tensors)) {
    for (const std::size_t input : tensors_.observation) input_size_ += model_.input(input).size();
    output_size_ = model_.output(tensors_.actions).size();
  }

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  [[nodiscard]] bool is_recurrent() const override { return !tensors_.states.empty() || tensors_.time_step; }
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

std::optional<std::size_t> find(std::span<const TensorInfo> tensors, std::string_view name) {
  const auto found = std::ranges::find(tensors, name, &TensorInfo::name);
  if (found == tensors.end()) return std::nullopt;
  return static_cast<std::size_t>(found - tensors.begin());
}

std::string names(std::span<const TensorInfo> tensors) {
  std::string all;
  for (const TensorInfo& tensor : tensors) all += (all.empty() ? "" : ", ") + tensor.name;
  return all;
}

std::vector<std::string> split_names(std::string_view list) {
  std::vector<std::string> words;
  while (!list.empty()) {
    const std::size_t end = std::min(list.find(','), list.size());
    std::string_view word = list.substr(0, end);
    while (word.starts_with(' ')) word.remove_prefix(1);
    while (word.ends_with(' ')) word.remove_suffix(1);
    words.emplace_back(word);
    list.remove_prefix(std::min(end + 1, list.size()));
  }
  return words;
}

struct Ending {
  std::string_view input, output;
};
constexpr std::array kStateEndings{Ending{"_in", "_out"}, Ending{".in", ".out"}, Ending{"h0", "hn"},
                                   Ending{"c0", "cn"}};

// The output that feeds a state input: by its name, and of the same shape.
std::optional<PolicyTensors::State> pair_state(const onnx_engine::Model& model, std::size_t input) {
  const TensorInfo& in = model.inputs()[input];
  for (const Ending& ending : kStateEndings) {
    if (!in.name.ends_with(ending.input)) continue;
    const std::string stem = in.name.substr(0, in.name.size() - ending.input.size());
    const auto output = find(model.outputs(), stem + std::string(ending.output));
    if (output && model.outputs()[*output].shape == in.shape) return PolicyTensors::State{input, *output};
  }
  return std::nullopt;
}

bool is_time_step(const onnx_engine::Model& model, std::size_t input) {
  const TensorInfo& info = model.inputs()[input];
  return info.name == "time_step" && std::ranges::all_of(info.shape, [](std::int64_t size) { return size == 1; });
}

// The inputs that `list` names, each once.
std::expected<std::vector<std::size_t>, std::string> find_all(std::span<const TensorInfo> inputs,
                                                              const std::string& list, const std::string& file) {
  std::vector<std::size_t> found;
  for (const std::string& name : split_names(list)) {
    const auto input = find(inputs, name);
    if (!input) {
      return std::unexpected(
          fmt::format("{}: no input named {}, it has {}; mend policy.input", file, name, names(inputs)));
    }
    if (std::ranges::find(found, *input) != found.end()) {
      return std::unexpected(fmt::format("{}: input {} is named twice; mend policy.input", file, name));
    }
    found.push_back(*input);
  }
  return found;
}

std::expected<std::size_t, std::string> find_actions(const onnx_engine::Model& model, const PolicyTensors& tensors,
                                                     const std::string& file, const std::string& name) {
  if (!name.empty()) {
    if (const auto actions = find(model.outputs(), name)) return *actions;
    return std::unexpected(
        fmt::format("{}: no output named {}, it has {}; mend policy.output", file, name, names(model.outputs())));
  }
  for (std::size_t i = 0; i < model.outputs().size(); ++i) {
    if (std::ranges::find(tensors.states, i, &PolicyTensors::State::output) == tensors.states.end()) return i;
  }
  return std::unexpected(fmt::format("{}: every output feeds a state; none is left for the actions", file));
}

}  // namespace

std::expected<PolicyTensors, std::string> assign_tensors(const onnx_engine::Model& model, const std::string& file,
                                                         const std::string& input, const std::string& output) {
  PolicyTensors tensors;
  auto observation = find_all(model.inputs(), input, file);
  if (!observation) return std::unexpected(observation.error());
  tensors.observation = *std::move(observation);
  for (std::size_t i = 0; i < model.inputs().size(); ++i) {
    if (!input.empty() && std::ranges::find(tensors.observation, i) != tensors.observation.end()) continue;
    if (const auto state = pair_state(model, i)) {
      tensors.states.push_back(*state);
    } else if (is_time_step(model, i)) {
      tensors.time_step = i;
    } else if (input.empty()) {
      tensors.observation.push_back(i);
    } else {
      return std::unexpected(fmt::format(
          "{}: input {} is neither the observation nor hidden state; list it in policy.input if the observation has "
          "its values, or name a hidden state <x>_in with an output <x>_out of the same shape",
          file, model.inputs()[i].name));
    }
  }
  if (tensors.observation.empty()) {
    return std::unexpected(fmt::format("{}: no input carries the observation; name it in policy.input", file));
  }
  const auto actions = find_actions(model, tensors, file, output);
  if (!actions) return std::unexpected(actions.error());
  tensors.actions = *actions;
  if (!model.lost_states().empty()) {
    return std::unexpected(fmt::format(
        "{}: {} begins every inference from the same state, so its memory is lost between observations; export the "
        "network with its state as inputs <x>_in and outputs <x>_out",
        file, model.lost_states().front()));
  }
  return tensors;
}

std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output) {
  auto model = onnx_engine::load(file);
  if (!model) return std::unexpected(model.error());
  auto tensors = assign_tensors(*model, file, input, output);
  if (!tensors) return std::unexpected(tensors.error());
  return std::make_unique<OnnxPolicy>(*std::move(model), *std::move(tensors));
}

}  // namespace takt::policy_host
