// SPDX-License-Identifier: Apache-2.0
// The built-in engine (policy_host/onnx) behind the Network and Policy ports. Which tensors are what:
// policy_tensors.hpp and, for a robot's own policy, assemble_policy.hpp.
//
// A recurrent network that is exported without its state is refused: it would run, and be wrong from the second
// observation on. The error is one line: file, what is wrong, how to correct it.
// Thread rule: load at set-up.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/network.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {

ModelTensors tensors_of(const onnx_engine::Model& model);

// A file as this engine reads it, and which of its tensors are what; `input` and `output` as assign_tensors() takes
// them.
struct OnnxReading {
  onnx_engine::Model model;
  PolicyTensors tensors;
};
std::expected<OnnxReading, std::string> read_onnx_policy(const std::filesystem::path& file, const std::string& input,
                                                         const std::string& output);

std::unique_ptr<Network> make_onnx_network(onnx_engine::Model model);
std::expected<std::unique_ptr<Network>, std::string> load_onnx_network(const std::filesystem::path& file);

// The robot's own by this engine, whatever policy.engine says (`takt policy replay`): an ONNX file or a LEAPP bundle,
// with its sampler where it has one (policy_host/flow). Precondition: robot.policy.
std::expected<std::unique_ptr<Policy>, std::string> load_robot_policy(const config::RobotConfig& robot);

// Of one ONNX file, `input` and `output` as assign_tensors() takes them.
std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output);

}  // namespace takt::policy_host
