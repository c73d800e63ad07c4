// SPDX-License-Identifier: Apache-2.0
#include "policy_host/policy_tensors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace takt::policy_host {

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

namespace {

using onnx_engine::TensorInfo;

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

struct Ending {
  std::string_view input, output;
};
constexpr std::array kStateEndings{Ending{"_in", "_out"}, Ending{".in", ".out"}, Ending{"h0", "hn"},
                                   Ending{"c0", "cn"}};

// The output that feeds a state input: by its name, and of the same shape.
std::optional<PolicyTensors::State> pair_state(const ModelTensors& model, std::size_t input) {
  const TensorInfo& in = model.inputs[input];
  const std::string next = name_of_next_state(in.name);
  if (next.empty()) return std::nullopt;
  const auto output = find(model.outputs, next);
  if (!output || model.outputs[*output].shape != in.shape) return std::nullopt;
  return PolicyTensors::State{input, *output};
}

bool is_number(const ModelTensors& model, std::size_t input, std::string_view name) {
  const TensorInfo& info = model.inputs[input];
  return info.name == name && std::ranges::all_of(info.shape, [](std::int64_t size) { return size == 1; });
}

// The tensors that `list` names, each once. `what`: "input" or "output".
std::expected<std::vector<std::size_t>, std::string> find_all(std::span<const TensorInfo> tensors,
                                                              const std::string& list, const std::string& file,
                                                              std::string_view what) {
  std::vector<std::size_t> found;
  for (const std::string& name : split_names(list)) {
    const auto tensor = find(tensors, name);
    if (!tensor) {
      return std::unexpected(
          fmt::format("{0}: no {1} named {2}, it has {3}; correct policy.{1}", file, what, name, names(tensors)));
    }
    if (std::ranges::find(found, *tensor) != found.end()) {
      return std::unexpected(fmt::format("{0}: {1} {2} is named twice; correct policy.{1}", file, what, name));
    }
    found.push_back(*tensor);
  }
  return found;
}

std::expected<std::vector<std::size_t>, std::string> find_outputs(const ModelTensors& model,
                                                                  const PolicyTensors& tensors, const std::string& file,
                                                                  const std::string& list) {
  if (!list.empty()) return find_all(model.outputs, list, file, "output");
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    if (std::ranges::find(tensors.states, i, &PolicyTensors::State::output) == tensors.states.end()) return {{i}};
  }
  return std::unexpected(fmt::format("{}: every output feeds a state; none is left for the actions", file));
}

}  // namespace

std::string name_of_next_state(std::string_view input) {
  for (const Ending& ending : kStateEndings)
    if (input.ends_with(ending.input))
      return std::string(input.substr(0, input.size() - ending.input.size())) + std::string(ending.output);
  return {};
}

std::expected<PolicyTensors, std::string> assign_tensors(const ModelTensors& model, const std::string& file,
                                                         const std::string& input, const std::string& output) {
  PolicyTensors tensors;
  auto observation = find_all(model.inputs, input, file, "input");
  if (!observation) return std::unexpected(observation.error());
  tensors.observation = *std::move(observation);
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    if (!input.empty() && std::ranges::find(tensors.observation, i) != tensors.observation.end()) continue;
    if (const auto state = pair_state(model, i)) {
      tensors.states.push_back(*state);
    } else if (is_number(model, i, "time_step")) {
      tensors.time_step = i;
    } else if (is_number(model, i, "ctx.step_count")) {
      tensors.step_count = i;
    } else if (input.empty()) {
      tensors.observation.push_back(i);
    } else {
      return std::unexpected(fmt::format(
          "{}: input {} is neither the observation nor hidden state; list it in policy.input if the observation has "
          "its values, or name a hidden state <x>_in with an output <x>_out of the same shape",
          file, model.inputs[i].name));
    }
  }
  if (tensors.observation.empty()) {
    return std::unexpected(fmt::format("{}: no input carries the observation; name it in policy.input", file));
  }
  auto outputs = find_outputs(model, tensors, file, output);
  if (!outputs) return std::unexpected(outputs.error());
  tensors.outputs = *std::move(outputs);
  if (!model.lost_states.empty()) {
    return std::unexpected(fmt::format(
        "{}: {} begins every inference from the same state, so its memory is lost between observations; export the "
        "network with its state as inputs <x>_in and outputs <x>_out",
        file, model.lost_states.front()));
  }
  return tensors;
}

}  // namespace takt::policy_host
