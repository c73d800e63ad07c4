// SPDX-License-Identifier: Apache-2.0
// What each tensor of a network is to a policy, by the names that its exporter gave them, whichever engine runs it.
//
// The inputs named in `input` carry the observation, one after the other; one output the actions, and further ones what
// else an answer has (config::named_outputs). Every further input
// must be one of
//   state      an input that the output of the previous inference feeds: `<x>_in` by `<x>_out` (rsl_rl's exporter,
//   LEAPP),
//              `memory.<x>.in` by `memory.<x>.out` (exploy), `h0` by `hn`, `c0` by `cn` (PyTorch's own names), of the
//              same shape; zeros after load and reset
//   time_step  one number: inferences since load or reset (motion trackers)
//   step count  `ctx.step_count`, likewise: exploy's files take its remainder
#pragma once

#include <cstddef>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "policy_host/onnx_engine/model.hpp"

namespace takt::policy_host {

// As a network declares them. `lost_states`: recurrent nodes, described, that forget between inferences what they were
// trained to remember; empty too where the engine does not look into the network.
struct ModelTensors {
  std::span<const onnx_engine::TensorInfo> inputs, outputs;
  std::span<const std::string> lost_states = {};
};

// Indices into the inputs and outputs.
struct PolicyTensors {
  struct State {
    std::size_t input;
    std::size_t output;
  };
  std::vector<std::size_t> observation;
  std::vector<State> states;
  std::optional<std::size_t> time_step, step_count;
  std::vector<std::size_t> outputs;  // the actions first
};

// The name of the output that feeds this input, if it is hidden state by its name; "": it is not.
std::string name_of_next_state(std::string_view input);

// `input`: names of the tensors that carry the observation, separated by commas; "": all inputs that nothing else
// feeds. `output`: names of the one that carries the actions and of what else an answer has, likewise; "": the first
// that feeds no state. `file` stands in the error, one line: what is wrong, how to correct it.
std::expected<PolicyTensors, std::string> assign_tensors(const ModelTensors& model, const std::string& file,
                                                         const std::string& input, const std::string& output);

// Of a list separated by commas, without blanks around them.
std::vector<std::string> split_names(std::string_view list);

}  // namespace takt::policy_host
