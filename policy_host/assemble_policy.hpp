// SPDX-License-Identifier: Apache-2.0
// The policy that a robot file names, of networks that any engine loads (engines/load_policy.hpp chooses it): an ONNX
// file, or the YAML of a LEAPP bundle with its networks beside it. Every value that it is shown comes from a term of
// the robot file, and every value that it gives goes where the robot file says; a sampler (flow/flow_policy.hpp) stands
// around the network where there is one.
//
// Refused, one line each: a network that is no policy (policy_tensors.hpp), a bundle whose networks are not those that
// were exported (leapp/leapp_graph.hpp), a term that reaches across two inputs, and a robot file that contradicts what
// the exporter says (binding.hpp, metadata_comparison.hpp), whichever engine runs it and however the file is called.
// Thread rule: set-up only.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/network.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

// Precondition: robot.policy.
std::expected<std::unique_ptr<Policy>, std::string> assemble_policy(const config::RobotConfig& robot,
                                                                    const LoadNetwork& load);

// A single ONNX file, `input` and `output` as assign_tensors() takes them.
std::expected<std::unique_ptr<Policy>, std::string> load_network_policy(const std::string& file,
                                                                        const std::string& input,
                                                                        const std::string& output,
                                                                        const LoadNetwork& load);

}  // namespace takt::policy_host
