// SPDX-License-Identifier: Apache-2.0
// What an exporter says of a policy, in the form that a robot file is written from. What it does not say becomes
// FILL_IN there, with the reason beside it; a source that no robot has of itself (the base's linear velocity) too.
//
// `robot_joints`: the robot's joints in its own order; empty: in the policy's. The error is one line: joints that are
// not said, or not the robot's. Thread rule: set-up only.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "config/deploy_file.hpp"
#include "policy_host/described_policy.hpp"

namespace takt::policy_host {

std::expected<config::DeployFile, std::string> deploy_file_of(const DescribedPolicy& policy,
                                                              std::vector<std::string>& robot_joints);

}  // namespace takt::policy_host
