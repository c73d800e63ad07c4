// An ONNX file behind the Policy port, run by policy_host/onnx.
//
// One input carries the observation, one output the actions. Further inputs must be hidden state: an input named
// `<x>_in` is fed with the output `<x>_out` of the previous step, zeros after load and reset (the naming of rsl_rl's
// exporter for LSTM and GRU policies). The error is one line: file, what is wrong, how to mend it.
// Thread rule: load at set-up.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "policy_host/policy.hpp"

namespace takt::policy_host {

// `input` and `output` are the names of the tensors that carry the observation and the actions.
std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output);

}  // namespace takt::policy_host
