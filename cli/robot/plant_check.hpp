// SPDX-License-Identifier: Apache-2.0
// What takt-plant would refuse of a robot file at its start: said before anything is started.
#pragma once

#include <string>

#include "config/robot_config.hpp"

namespace takt::cli {

// One problem per line; empty: none. `simulation` is looked at as the plant does that plays the robot itself; with a
// `world`, as simulation::WorldProcess has it, that is asked instead.
std::string refused_by_plant(const config::RobotConfig& robot, const std::string& world);

}  // namespace takt::cli
