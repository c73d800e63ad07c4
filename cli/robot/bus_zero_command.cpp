// SPDX-License-Identifier: Apache-2.0
// takt bus zero: where a joint is becomes its zero, in the drive or in the robot file.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "cli/command.hpp"
#include "cli/robot/direct_bus.hpp"
#include "cli/robot/drive_listener.hpp"
#include "commissioning/discovery.hpp"
#include "commissioning/home_place.hpp"
#include "config/joint_units.hpp"
#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::cli {
namespace {

struct BusZeroOptions {
  std::string joint, robot_file, runtime_dir;
  bool yes = false;
};

constexpr double kAtZero = 0.02;  // rad, joint side

std::expected<int, Refusal> set_zero(const BusZeroOptions& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto index = find_joint(*robot, options.joint);
  if (!index) return std::unexpected(index.error());
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  const config::Joint& joint = robot->config.joints[*index];
  if (commissioning::forgets_home(joint.drive) &&
      joint.drive.position_after_power_up != config::PositionAfterPowerUp::within_a_turn)
    return std::unexpected(
        Refusal{kExitFailed,
                fmt::format("joint {}: its drive forgets its zero with its supply, so it is told at every power-up: "
                            "{}",
                            joint.name, drivers::home_command(robot->config, *index))});
  auto driver = drivers::make_lone_driver(robot->config, *index);
  if (!driver) return std::unexpected(Refusal{config::kExitBadConfiguration, driver.error()});
  auto bus = open_bus(*robot, joint.bus);
  if (!bus) return std::unexpected(bus.error());
  DriveListener listener(**bus, **driver, robot->config.control.period);
  if (!listener.wait_until_disabled())
    return std::unexpected(
        Refusal{kExitFailed, fmt::format("joint {}: {}", joint.name, listener.why_not_disabled(joint.drive))});
  const double before = listener.q();
  const std::string_view unit = config::kJointPosition.unit(joint.kind);
  const auto frames = commissioning::zero_frames(joint.drive);
  if (frames.empty()) {
    fmt::print(
        "joint {0} reads {1:.4f} {3}; its drive keeps no zero over CAN: write `offset: {2:.4f} {3}` into its drive\n",
        joint.name, before, joint.drive.offset - before, unit);
    return kExitOk;
  }
  if (!options.yes) {
    fmt::print(
        "joint {0} reads {1:.4f} {3}; with --yes its drive takes that for its zero, and the joint reads {2:.4f} {3}\n",
        joint.name, before, joint.drive.offset, unit);
    return kExitOk;
  }
  for (const drivers::CanFrame& frame : frames) (*bus)->send(frame);
  listener.settle();
  if (std::abs(listener.q() - joint.drive.offset) > kAtZero * config::per_rad(joint))
    return std::unexpected(Refusal{kExitFailed, fmt::format("joint {} still reads {:.4f} {}: its drive did not take it",
                                                            joint.name, listener.q(), unit)});
  const bool is_saved = joint.drive.protocol == config::DriveProtocol::robstride;
  fmt::print("joint {0} read {1:.4f} {3} and reads {2:.4f} {3} now; {4}\n", joint.name, before, listener.q(), unit,
             is_saved ? "its drive was told to save it (type 22)"
                      : "its drive should keep it: look again after its next power-on");
  return kExitOk;
}

}  // namespace

void add_bus_zero(CLI::App& bus, int& exit_code) {
  CLI::App* command = bus.add_subcommand("zero", "Make where a joint stands its zero; its drive stays disabled.");
  auto options = std::make_shared<BusZeroOptions>();
  command->add_option("joint", options->joint, "name in the robot file")->required();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", options->runtime_dir,
                      "where loopback buses are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  command->add_flag("--yes", options->yes, "do it; without, only what would happen is said");
  command->footer(
      "Example: takt bus zero elbow --robot robot.yaml --yes\n"
      "Drives that forget it with their supply (moteus, position_after_power_up: unknown or one_of_several): takt "
      "joint home.\n"
      "Drives that keep none over CAN (odrive, cia402, a RobStride in MIT protocol): the `offset` to write into the "
      "robot file is printed.\n"
      "Exit codes: 0 done or said, 1 refused or the drive did not take it, 64 command line, 65 configuration, 69 the "
      "bus "
      "is not there.");
  command->callback([options, &exit_code] {
    const auto done = set_zero(*options);
    if (!done) fmt::print(stderr, "takt bus zero: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
