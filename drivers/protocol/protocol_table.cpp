// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/protocol_table.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "drivers/protocol/cia402/cia402_driver.hpp"
#include "drivers/protocol/mit/mit_driver.hpp"
#include "drivers/protocol/moteus/moteus_driver.hpp"
#include "drivers/protocol/odrive/odrive_driver.hpp"
#include "drivers/protocol/placed_driver.hpp"
#include "drivers/protocol/robstride/robstride_driver.hpp"

namespace takt::drivers {
namespace {

// Data path order: commands leave through one of these rows.
constexpr std::array kProtocols{
    Protocol{config::DriveProtocol::mit, make_mit_driver, mit_traffic, mit_error_name, mit_card_rows,
             mit_settings_told},
    Protocol{config::DriveProtocol::odrive, make_odrive_driver, odrive_traffic, odrive_error_name, odrive_card_rows,
             odrive_settings_told},
    Protocol{config::DriveProtocol::cia402, make_cia402_driver, cia402_traffic, cia402_error_name, cia402_card_rows,
             cia402_settings_told},
    Protocol{config::DriveProtocol::robstride, make_robstride_driver, robstride_traffic, robstride_error_name,
             robstride_card_rows, robstride_settings_told},
    Protocol{config::DriveProtocol::moteus, make_moteus_driver, moteus_traffic, moteus_error_name, moteus_card_rows,
             moteus_settings_told},
};

std::string home_command(std::string_view joint, std::string_view file, std::string_view place) {
  return "takt joint home " + std::string(joint) + " --robot " + std::string(file) + " --at " + std::string(place);
}

// `home`: the command that tells a drive its place.
std::string setup_fault_name(std::uint32_t code, const std::string& home) {
  if ((code & 0x8000'0000U) == 0) return {};
  switch (kind_of(code)) {
    case SetupFault::settings_differ:
      return "the drive's own settings differ from the robot file";
    case SetupFault::settings_unread:
      return "the drive does not tell its settings";
    case SetupFault::setup_refused:
      return "the drive refused its set-up";
    case SetupFault::watchdog_off:
      return "the drive's own time-out is off or longer than 1 s, so nothing stops it when this computer dies (set it, "
             "or write drive.watchdog_waiver)";
    case SetupFault::watchdog_unknown:
      return "the drive does not tell its own time-out, so perhaps nothing stops it when this computer dies (see to "
             "it, "
             "then write drive.watchdog_waiver)";
    case SetupFault::other_protocol:
      return "the drive speaks another protocol than the robot file says";
    case SetupFault::home_unknown:
      return "where the joint is, is not known: its drive started, or fell silent and may have lost its supply (" +
             home + ")";
  }
  return {};
}

}  // namespace

const Protocol* find_protocol(config::DriveProtocol id) {
  for (const Protocol& protocol : kProtocols)
    if (protocol.id == id) return &protocol;
  return nullptr;
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_joint_driver(const config::RobotConfig& robot,
                                                                           std::size_t joint) {
  const config::Joint& wanted = robot.joints.at(joint);
  const auto refusal = [&wanted](const std::string& what) {
    return std::unexpected("joint " + wanted.name + ": " + what);
  };
  const config::Drive& drive = wanted.drive;
  if (std::abs(drive.direction) != 1 || !(drive.gear_ratio > 0))
    return refusal("direction must be 1 or -1 and gear_ratio positive");
  const Protocol* const protocol = find_protocol(drive.protocol);
  if (protocol == nullptr) return refusal("this build does not speak " + std::string(config::name(drive.protocol)));
  auto driver = protocol->make(robot, joint);
  if (!driver) return refusal(driver.error());
  const auto rule = place_rule(robot, joint);
  if (!rule) return driver;
  return std::make_unique<PlacedDriver>(*rule, std::move(*driver));
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_lone_driver(const config::RobotConfig& robot,
                                                                          std::size_t joint) {
  config::RobotConfig alone = robot;
  alone.joints = {robot.joints.at(joint)};
  return make_joint_driver(alone, 0);
}

namespace {

std::string error_name(const config::Drive& drive, std::uint32_t code, const std::string& home) {
  const Protocol* const protocol = find_protocol(drive.protocol);
  std::string own_name = protocol == nullptr ? std::string() : protocol->error_name(drive, code);
  if (const std::string name = setup_fault_name(code, home); !name.empty())
    return setting_of(code) != 0 && !own_name.empty() ? name + ": " + own_name : name;
  if (!own_name.empty()) return own_name;
  std::array<char, 32> number{};
  std::snprintf(number.data(), number.size(), "error code 0x%x", code);
  return number.data();
}

}  // namespace

std::string error_name(const config::Drive& drive, std::uint32_t code) {
  return error_name(drive, code, home_command("JOINT", "FILE", "ANGLE"));
}

std::string home_command(const config::RobotConfig& robot, std::size_t joint) {
  const config::Joint& known = robot.joints.at(joint);
  return home_command(known.name, robot.file, known.kind == config::JointKind::slide ? "LENGTH" : "ANGLE");
}

std::string error_text(const config::RobotConfig& robot, std::size_t joint, std::uint32_t code) {
  return error_name(robot.joints.at(joint).drive, code, home_command(robot, joint));
}

}  // namespace takt::drivers
