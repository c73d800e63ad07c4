// An ONNX file behind the Policy port, run by policy_host/onnx.
//
// The inputs named in `input` carry the observation, one after the other; one output the actions. Every further input
// must be one of
//   state      an input that the output of the previous inference feeds: `<x>_in` by `<x>_out` (rsl_rl's exporter,
//   LEAPP),
//              `memory.<x>.in` by `memory.<x>.out` (exploy), `h0` by `hn`, `c0` by `cn` (PyTorch's own names), of the
//              same shape; zeros after load and reset
//   time_step  one number: inferences since load or reset (motion trackers)
// A recurrent network that is exported without its state is refused: it would run, and be wrong from the second
// observation on. The error is one line: file, what is wrong, how to mend it.
// Thread rule: load at set-up.
#pragma once

#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "policy_host/policy.hpp"

namespace takt::onnx_engine {
class Model;
}

namespace takt::policy_host {

// What each tensor of a model is to a policy; indices into the model's inputs and outputs.
struct PolicyTensors {
  struct State {
    std::size_t input;
    std::size_t output;
  };
  std::vector<std::size_t> observation;
  std::vector<State> states;
  std::optional<std::size_t> time_step;
  std::size_t actions = 0;
};

// `input`: names of the tensors that carry the observation, separated by commas; "": all inputs that nothing else
// feeds. `output`: name of the one that carries the actions; "": the first that feeds no state. `file` stands in the
// error.
std::expected<PolicyTensors, std::string> assign_tensors(const onnx_engine::Model& model, const std::string& file,
                                                         const std::string& input, const std::string& output);

// `input` and `output` as assign_tensors() takes them.
std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output);

}  // namespace takt::policy_host
