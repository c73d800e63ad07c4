// SPDX-License-Identifier: Apache-2.0
// Writes a robot file from a deploy.yaml and, where given, the robot's published model: everything they know is carried
// over; what they cannot know (drives, CAN ids, the freshness contract) is written as FILL_IN, which the loader refuses
// key by key until a person has replaced it. Nothing about the hardware is invented, unless a simulated robot is asked
// for: then buses, drives and the contract are made up so that it runs at once, and the file ends with their list.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/deploy_file.hpp"
#include "config/model_facts.hpp"

namespace takt::config {

struct ImportOptions {
  std::string robot;                     // name of the robot
  std::string policy_file;               // as it shall stand in the file; empty: there is no policy
  std::vector<std::string> joint_names;  // of the model or the export, robot's order; empty: joint_00, joint_01, ...
  std::string source;                    // for the first comment
  std::string input{}, output{};         // as policy.input and policy.output; empty: the defaults
  std::optional<ModelFacts> model{};     // names (unless given), position limits, torques, inertias
  std::string model_file{};              // as it shall stand in the file
  std::optional<Model> bodies{};         // one link per joint, by its name in the model; none: no `model` is written
  bool simulated = false;                // needs `model`
};

// The order in which a robot's maker numbers its motors, as far as its model tells: that of the actuators where each
// hinge has one, else that of the bodies. Unitree's quadrupeds have the left legs' bodies and the right legs' motors
// first.
struct MotorOrder {
  std::vector<std::string> joints;
  std::string remark;  // one sentence where the two differ, or where only some joints have an actuator; else empty
};
MotorOrder motor_order(const ModelFacts& model);

// Text of the robot file; the error is one sentence about the options.
std::expected<std::string, std::string> import_deploy_file(const DeployFile& deploy, const ImportOptions& options);

}  // namespace takt::config
