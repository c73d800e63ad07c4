// SPDX-License-Identifier: Apache-2.0
// A robot's fallback policy for rollouts: a host of its own, which lives through what befalls the policy's.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/policy.hpp"

namespace takt::evidence {

struct FallbackHost {
  config::RobotConfig robot;  // as this host sees it: config::seen_by_fallback
  std::unique_ptr<policy_host::Policy> policy;
  std::uint64_t policy_hash = 0;
};

// Null: the robot has none. The error is one line: the file cannot be read, or does not fit the robot.
std::expected<std::unique_ptr<FallbackHost>, std::string> load_fallback_host(const config::RobotConfig& robot);

}  // namespace takt::evidence
