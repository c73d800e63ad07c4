// SPDX-License-Identifier: Apache-2.0
// Which ticks each drive is written to, of those that are written to every n-th (`drive.every`): spread so that every
// tick puts about as many drives on a bus as any other. Pure; a function of the robot file alone.
#pragma once

#include <cstddef>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {

inline constexpr std::uint32_t kMostTicksPerTurn = 8;
inline constexpr std::size_t kTurnPattern = 840;  // ticks after which every pattern of turns begins anew

// One per joint, in the joints' order.
std::vector<Turns> turns_of(const RobotConfig& robot);

// From one of its turns to the next.
inline Duration turn_of(const RobotConfig& robot, const Joint& joint) {
  return robot.control.period * joint.drive.every;
}

}  // namespace takt::config
