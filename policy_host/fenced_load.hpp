// SPDX-License-Identifier: Apache-2.0
// A robot's policy loaded where it cannot get at the control loop: the process is kept off the executive's processor
// before anything of an engine runs (processor_fence.hpp), thread pools are told policy.engine.threads, and what was
// loaded is held to both.
//
// An engine that made more threads than policy.engine.threads for each network, and kSpareThreads besides, is refused.
// What it starts while it infers is not counted; the fence holds it too.
//
// Errors: one line. Thread rule: set-up; it changes the whole process, for good.
#pragma once

#include <cstddef>
#include <expected>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/processor_fence.hpp"

namespace takt::policy_host {

// Makes the engine ready for this robot, whose `policy` section is there and consistent; never null. The error is one
// line: what is wrong, how to correct it; the program then says so and ends with 65. Called once, before anything is
// attached, or policy.requests_in_flight times; it may take as long as it needs, and keep no reference to the robot.
using LoadPolicy = std::function<std::expected<std::unique_ptr<Policy>, std::string>(const config::RobotConfig& robot)>;

// Of a driver's own, such as CUDA's, and of a library's that waits.
inline constexpr std::size_t kSpareThreads = 8;

struct FencedPolicies {
  std::vector<std::unique_ptr<Policy>> policies;
  Fence fence = Fence::none;
  std::size_t threads = 0;  // that loading started
};

// `count` policies by `load`, each of which fits the robot. Precondition: check_policy_section(robot).
std::expected<FencedPolicies, std::string> load_fenced(const config::RobotConfig& robot, std::size_t count,
                                                       const LoadPolicy& load);

}  // namespace takt::policy_host
