// SPDX-License-Identifier: Apache-2.0
// takt bus up: the kernel's CAN interfaces get the bit timing of the robot file, so that it stands in one place only.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "cli/command.hpp"
#include "cli/robot/bus_up_steps.hpp"
#include "cli/robot/direct_bus.hpp"
#include "cli/robot/executive_guard.hpp"
#include "cli/run/external_tool.hpp"
#include "config/load.hpp"
#include "drivers/bus/can_link.hpp"

namespace takt::cli {
namespace {

struct BusUpOptions {
  std::string robot_file, interface;
  bool dry_run = false;
};

std::expected<void, Refusal> bring_interface_up(const config::RobotConfig& robot, std::size_t index, bool dry_run) {
  const std::string& interface = robot.buses[index].interface;
  const auto look = [&interface] { return drivers::read_can_link(interface); };
  if (dry_run) {
    for (const UpStep& step : up_steps(robot, index, kind_of(look()))) fmt::print("{}\n", line_of(step.command));
    return {};
  }
  if (!std::filesystem::exists("/sys/class/net/" + interface))
    return std::unexpected(
        Refusal{kExitUnavailable,
                fmt::format("this machine has no interface {}: plug the adapter in, or load its driver", interface)});
  const auto told = bring_up(robot, index, {run_tool, look});
  if (!told) return std::unexpected(told.error());
  for (const std::string& sentence : *told) fmt::print("{}\n", sentence);
  return {};
}

// A controller that is bus-off carries nothing that could be taken from under a robot.
bool carries_frames(const std::string& interface) {
  const drivers::CanLink link = drivers::read_can_link(interface);
  return link.exists && link.up && link.controller_state != "BUS-OFF";
}

std::expected<int, Refusal> up(const BusUpOptions& options) {
  const auto robot = load_robot(options.robot_file, {});
  if (!robot) return std::unexpected(robot.error());
  std::vector<std::size_t> chosen;
  bool carries = false;  // one of them: it would be taken from under a robot that moves
  for (std::size_t index = 0; index < robot->config.buses.size(); ++index) {
    const std::string& interface = robot->config.buses[index].interface;
    if (!options.interface.empty() && interface != options.interface) continue;
    chosen.push_back(index);
    carries = carries || carries_frames(interface);
  }
  if (chosen.empty())
    return std::unexpected(
        Refusal{kExitUsage, fmt::format("{} has no bus on interface {}", options.robot_file, options.interface)});
  if (carries && !options.dry_run) {
    if (const auto disarmed = require_disarmed(robot->executives); !disarmed) return std::unexpected(disarmed.error());
  }
  for (const std::size_t index : chosen) {
    if (const auto done = bring_interface_up(robot->config, index, options.dry_run); !done)
      return std::unexpected(done.error());
  }
  return kExitOk;
}

}  // namespace

void add_bus_up(CLI::App& bus, int& exit_code) {
  CLI::App* command = bus.add_subcommand("up", "Give the CAN interfaces the robot file's bit rates and bring them up.");
  auto options = std::make_shared<BusUpOptions>();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--interface", options->interface, "only this one");
  command->add_flag("--dry-run", options->dry_run, "print the commands instead of running them");
  command->footer(
      "Example: sudo takt bus up --robot robot.yaml\n"
      "takt-can@IFACE.service does this for one interface when its adapter appears.\n"
      "Refused of interfaces that are up while the robot is armed: they go down before their bit rates change. One "
      "that is\n"
      "bus-off is brought up anew at any time.\n"
      "Exit codes: 0 up, 1 armed, or the kernel refused, 64 command line, 65 configuration, 69 no such interface.");
  command->callback([options, &exit_code] {
    const auto done = up(*options);
    if (!done) fmt::print(stderr, "takt bus up: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
