// SPDX-License-Identifier: Apache-2.0
// Which change of a ringing joint's gains in the robot file ends the ringing: found by computing the loop again with
// other gains, the smallest change first, stiffness kept where it can be. Pure but for the mechanics, which are fresh
// copies.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>

#include "config/robot_config.hpp"
#include "lab/study/joint_margins.hpp"

namespace takt::study {

// "raise gains.kd from 2 to 2.6 Nms/rad", or why none is known.
std::string gain_advice(const config::RobotConfig& robot, std::size_t joint, const DynamicsMaker& dynamics,
                        const Eigen::VectorXd& pose);

}  // namespace takt::study
