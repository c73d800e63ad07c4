// SPDX-License-Identifier: Apache-2.0
// A robot file against what an exporter says of joints and actions: what contradicts it is refused, what a robot may
// have of its own (gains, pose) is said.
//
// mjlab prints three decimals, so that a comparison with rounded metadata bears half of the last one. Errors: one line,
// what contradicts what and how to correct it. Thread rule: set-up only.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "policy_host/described_policy.hpp"
#include "policy_host/exporter_metadata.hpp"

namespace takt::policy_host {

// Gains and poses that are others in the robot's file, one sentence each. `where`: "the policy's metadata". Joints that
// the robot does not have are left out. `tolerance`: rad, Nm/rad, Nms/rad.
std::vector<std::string> joint_differences(const DescribedJoints& said, const config::RobotConfig& robot,
                                           double tolerance, const std::string& where);

// Refused: joints of another name or in another order than policy.joint_order, another order, scale or offset of the
// actions, other histories: with each of them the network would be shown or mean something else. What it says
// differently besides, one sentence each. Precondition: robot.policy. No joint_names: nothing.
std::expected<std::vector<std::string>, std::string> compare_metadata(const ExporterMetadata& metadata,
                                                                      const config::RobotConfig& robot);

}  // namespace takt::policy_host
