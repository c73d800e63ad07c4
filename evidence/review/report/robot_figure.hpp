// SPDX-License-Identifier: Apache-2.0
// What a page needs to draw the robot as a stick figure from its joint angles (page/robot.js).
//
//   {"kind":"links","links":[{"parent":-1,"xyz":[m],"rpy":[rad],"axis":[..],"slides":true}],"tool":{"link":5,"xyz":[m]},"reach":m}
//   {"kind":"cart_pole","pulley_radius":m,"pole_length":m,"reach":m}
//   null: the robot's file describes no geometry
// Link i is moved by joint i. reach: no point is farther from the base; of a cart, from the middle of its belt.
#pragma once

#include <nlohmann/json.hpp>

#include "config/robot_config.hpp"

namespace takt::evidence {

nlohmann::ordered_json robot_figure(const config::RobotConfig& robot);

}  // namespace takt::evidence
