// SPDX-License-Identifier: Apache-2.0
// A robot file that is valid in itself and fits what lies around it: its policy can be read, its buses carry their
// load.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/protocol/bus_load.hpp"

namespace takt::cli {

struct CheckedRobot {
  config::RobotConfig robot;
  std::vector<drivers::BusLoad> loads;
};

// The error: one problem per line; exit code config::kExitBadConfiguration.
std::expected<CheckedRobot, std::string> check_robot_file(const std::string& path);

// What the file costs or takes on trust: of itself, and what it offers as safe that no panel showed.
std::vector<std::string> cautions_of(const config::RobotConfig& robot);
// The same on stderr, before a robot is run.
void tell_cautions(const config::RobotConfig& robot);

// For a terminal: the first ten of `problems`, one per line, and how many more there are.
std::string first_problems(const std::string& problems);

}  // namespace takt::cli
