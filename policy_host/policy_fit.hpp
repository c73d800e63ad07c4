// SPDX-License-Identifier: Apache-2.0
// Does this policy belong to this robot? The sizes that a robot file's observation terms and action add up to
// (config/observation_shape.hpp) are compared with what the network wants, before anything attaches to the executive.
//
// Errors: one line that names both sizes and shows the arithmetic. Thread rule: set-up only.
#pragma once

#include <expected>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

// Everything about the policy section that can be judged without the network: sensors exist, joint lists are within
// range and without repetition, one scale or one per value, capacities.
std::expected<void, std::string> check_policy_section(const config::RobotConfig& robot);
// Input and output sizes. Precondition: check_policy_section passed.
std::expected<void, std::string> check_fit(const config::RobotConfig& robot, const Policy& policy);

}  // namespace takt::policy_host
