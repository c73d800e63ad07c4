// SPDX-License-Identifier: Apache-2.0
// Access to a robot's buses without an executive, for the person at the robot. A sender asks first
// (require_alone).
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/interface_claim.hpp"
#include "drivers/torque_output/torque_output.hpp"

namespace takt::cli {

struct DirectRobot {
  config::RobotConfig config;
  std::string runtime_directory;
  std::vector<std::string> executives;  // runtime directories where one may have the buses
};

// `runtime_directory` empty: the robot's default one. An executive may also run where the systemd units have theirs,
// unless a directory is named and every bus is simulated.
std::expected<DirectRobot, Refusal> load_robot(const std::string& robot_file, const std::string& runtime_directory);
std::expected<std::size_t, Refusal> find_joint(const DirectRobot& robot, const std::string& name);
// For senders: refused while an executive, or another process of Takt, has one of the buses. What is returned
// keeps others away for as long as it lives.
std::expected<std::vector<drivers::InterfaceClaim>, Refusal> require_alone(const DirectRobot& robot);
// Every frame on the bus is received, whatever its sender and receiver.
std::expected<std::unique_ptr<drivers::CanBus>, Refusal> open_bus(const DirectRobot& robot, std::size_t bus);
// Permitted until it is destroyed; null where the robot has no output that permits torque.
std::expected<std::unique_ptr<drivers::TorqueOutput>, Refusal> permit_torque(const config::RobotConfig& robot);

}  // namespace takt::cli
