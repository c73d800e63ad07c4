// SPDX-License-Identifier: Apache-2.0
// The robot's configuration as the tick wants it: fixed-size, float32, no strings. A hash of 0 accepts any policy.
#pragma once

#include <cstdint>

#include "config/robot_config.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::setup {

// Who closes the joint's loop, and what its drive's gains can say.
void set_loop(const config::Drive& drive, pipeline::JointConfig& joint);

// `fallback_hash`: of the fallback policy's file, where the robot has one.
pipeline::TickConfig tick_config_of(const config::RobotConfig& robot, std::uint64_t policy_hash,
                                    std::uint64_t fallback_hash = 0);

}  // namespace takt::setup
