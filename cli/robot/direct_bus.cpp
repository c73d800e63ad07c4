// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/direct_bus.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "cli/robot/executive_guard.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "drivers/bus/open_bus.hpp"
#include "drivers/bus/socketcan_bus.hpp"

namespace takt::cli {
namespace {

// A simulated bus is the plant's alone; an interface of the kernel is there for every executive of this machine.
bool has_real_bus(const config::RobotConfig& robot) {
  return std::ranges::any_of(robot.buses, drivers::SocketCanBus::interface_exists, &config::Bus::interface);
}

}  // namespace

std::expected<DirectRobot, Refusal> load_robot(const std::string& robot_file, const std::string& runtime_directory) {
  auto robot = config::load(robot_file);
  if (!robot) return std::unexpected(Refusal{config::kExitBadConfiguration, robot.error()});
  const bool is_named = !runtime_directory.empty();
  const std::string own = is_named ? runtime_directory : config::default_runtime_directory(robot->robot);
  std::vector<std::string> executives{own};
  // Of what runs elsewhere on this machine the claims know (require_alone).
  const bool may_be_the_units = !is_named || has_real_bus(*robot);
  if (may_be_the_units && own != config::kServiceRuntimeDirectory)
    executives.emplace_back(config::kServiceRuntimeDirectory);
  return DirectRobot{std::move(*robot), own, std::move(executives)};
}

std::expected<std::size_t, Refusal> find_joint(const DirectRobot& robot, const std::string& name) {
  std::string known;
  for (std::size_t joint = 0; joint < robot.config.joints.size(); ++joint) {
    if (robot.config.joints[joint].name == name) return joint;
    known += (joint == 0 ? "" : ", ") + robot.config.joints[joint].name;
  }
  return std::unexpected(
      Refusal{kExitUsage, fmt::format("{} has no joint `{}`; it has {}", robot.config.file, name, known)});
}

std::expected<std::vector<drivers::InterfaceClaim>, Refusal> require_alone(const DirectRobot& robot) {
  if (const auto free = require_no_executive(robot.executives); !free) return std::unexpected(free.error());
  auto claims = drivers::claim_interfaces(robot.config.buses);
  if (!claims) return std::unexpected(Refusal{kExitFailed, claims.error()});
  return std::move(*claims);
}

std::expected<std::unique_ptr<drivers::CanBus>, Refusal> open_bus(const DirectRobot& robot, std::size_t bus) {
  auto opened = drivers::open_bus(robot.config.buses.at(bus), robot.runtime_directory);
  if (!opened) return std::unexpected(Refusal{kExitUnavailable, opened.error()});
  return std::move(opened->bus);
}

std::expected<std::unique_ptr<drivers::TorqueOutput>, Refusal> permit_torque(const config::RobotConfig& robot) {
  if (!robot.safe_torque_off) return nullptr;
  auto opened = drivers::open_torque_output(*robot.safe_torque_off);
  if (!opened) return std::unexpected(Refusal{kExitFailed, opened.error()});
  if (!opened->output->tell(true))
    return std::unexpected(
        Refusal{kExitFailed, fmt::format("safety.safe_torque_off: {} does not do as it is told", opened->description)});
  return std::move(opened->output);
}

}  // namespace takt::cli
