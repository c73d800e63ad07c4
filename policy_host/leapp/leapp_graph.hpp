// SPDX-License-Identifier: Apache-2.0
// The networks of a LEAPP bundle, loaded and wired as its YAML says.
//
// Refused, one line each: a network whose SHA-256 is not the YAML's, or for which the YAML has none; a backend other
// than onnx; tensors of another name, shape or type than the YAML's; feedback without start values; an input from
// outside that `input` does not list. Thread rule: set-up only.
#pragma once

#include <expected>
#include <string>

#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/network_policy.hpp"

namespace takt::policy_host {

// The network of a node, where the bundle says it is and as it was exported: its path, checked. `bundle`: the YAML.
std::expected<std::string, std::string> checked_model_file(const std::string& bundle, const LeappNode& node);

// `input`, `output`: ports of pipeline.inputs and outputs, "tensor" or "node/tensor", separated by commas; "": all
// inputs, and the first output.
std::expected<NetworkGraph, std::string> load_leapp_graph(const std::string& bundle, const std::string& input,
                                                          const std::string& output, const LoadNetwork& load);

}  // namespace takt::policy_host
