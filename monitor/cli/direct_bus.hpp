// Access to a robot's buses without an executive, for the person at the robot: refused while one runs, for two masters
// on one bus fight over its drives.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/can_bus.hpp"
#include "monitor/cli/command.hpp"

namespace takt::cli {

struct DirectRobot {
  config::RobotConfig config;
  std::string runtime_directory;
};

// `runtime_directory` empty: the robot's default one.
std::expected<DirectRobot, Refusal> load_robot(const std::string& robot_file, const std::string& runtime_directory);
// Refused when an executive answers there.
std::expected<void, Refusal> require_no_executive(const DirectRobot& robot);
std::expected<std::size_t, Refusal> find_joint(const DirectRobot& robot, const std::string& name);
// Every frame on the bus is received, whoever it is from or for.
std::expected<std::unique_ptr<drivers::CanBus>, Refusal> open_bus(const DirectRobot& robot, std::size_t bus);

}  // namespace takt::cli
