// An ONNX file behind the Policy port, run by policy_host/onnx. Which of its tensors is what: policy_tensors.hpp.
//
// A recurrent network that is exported without its state is refused: it would run, and be wrong from the second
// observation on. The error is one line: file, what is wrong, how to mend it.
// Thread rule: load at set-up.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {

ModelTensors tensors_of(const onnx_engine::Model& model);

// `input` and `output` as assign_tensors() takes them; `file` stands in the error.
std::expected<std::unique_ptr<Policy>, std::string> make_onnx_policy(onnx_engine::Model model, const std::string& file,
                                                                     const std::string& input,
                                                                     const std::string& output);
std::expected<std::unique_ptr<Policy>, std::string> load_onnx_policy(const std::string& file, const std::string& input,
                                                                     const std::string& output);
// The robot's own by this engine, whatever policy.engine says (`takt policy replay`): the network in policy.file, and
// the sampler around it where there is one (policy_host/flow).
// Precondition: robot.policy.
std::expected<std::unique_ptr<Policy>, std::string> load_robot_policy(const config::RobotConfig& robot);

}  // namespace takt::policy_host
