// SPDX-License-Identifier: Apache-2.0
// Which values of a policy's inputs come from which term of the robot file, with unit, frame and order: for every
// network, whatever exported it. "obs 3..8: joint_velocity of 6 joints, rad/s, times 0.1".
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::policy_host {

struct FilledTensor {
  std::string name;
  std::size_t size = 0;
};

// One line per term. Preconditions: robot.policy; the terms fill `inputs` one after the other (policy_fit.hpp).
std::vector<std::string> bound_lines(std::span<const FilledTensor> inputs, const config::RobotConfig& robot);
// What becomes of the actions: "actions: joint_position of 12 joints, times 0.25, from home, rad".
std::string action_line(const config::RobotConfig& robot);

}  // namespace takt::policy_host
