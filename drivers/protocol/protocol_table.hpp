// SPDX-License-Identifier: Apache-2.0
// What a protocol brings to the host side, one row each. Adding a protocol: drivers/protocol/README.md.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/protocol/drive_card.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers {

// A frame that crosses the bus regularly on a drive's account.
struct FrameTraffic {
  std::size_t bytes = 0;  // of data
  bool extended = false;
  bool fd = false;      // with bit rate switch
  double per_tick = 1;  // how many of them, on average
};

struct Protocol {
  config::DriveProtocol id = config::DriveProtocol::mit;
  // The driver of robot.joints[joint]. Set-up only; the error is what is wrong, without the joint's name.
  std::expected<std::unique_ptr<JointDriver>, std::string> (*make)(const config::RobotConfig& robot,
                                                                   std::size_t joint) = nullptr;
  // Commands and replies alike, while the drive is enabled.
  std::vector<FrameTraffic> (*traffic)(const config::RobotConfig& robot, std::size_t joint) = nullptr;
  // A sentence's worth of JointFeedback::error_code, such as "motor over-temperature"; empty: not a code of this
  // protocol. Codes that all drivers share are named by error_name() below; of those that tell which setting is meant
  // (setting_of), this one names the setting.
  std::string (*error_name)(const config::Drive& drive, std::uint32_t code) = nullptr;
  // What the card of robot.joints[joint] has room for, rows about one item beside each other.
  std::vector<CardRow> (*card_rows)(const config::RobotConfig& robot, std::size_t joint) = nullptr;
  // Which settings this frame of the drive's tells; another's tells none. No allocation.
  void (*settings_told)(const config::Drive& drive, const CanFrame& frame, ToldSettings& told) = nullptr;
};

inline JointMapping mapping_of(const config::Drive& drive) {
  return {.ratio = static_cast<float>(drive.direction * drive.gear_ratio), .offset = static_cast<float>(drive.offset)};
}

// Null: this build does not speak it.
const Protocol* find_protocol(config::DriveProtocol id);

// The error is one sentence that names the joint.
std::expected<std::unique_ptr<JointDriver>, std::string> make_joint_driver(const config::RobotConfig& robot,
                                                                           std::size_t joint);

// The same for a joint that is driven alone, the rest of its bus left in peace: for tools. Where a bus's drives share
// frames, this driver sends them.
std::expected<std::unique_ptr<JointDriver>, std::string> make_lone_driver(const config::RobotConfig& robot,
                                                                          std::size_t joint);

// Never empty: an unknown code comes out as its number.
std::string error_name(const config::Drive& drive, std::uint32_t code);
// The same of a robot's joint, a command in it as it is typed but for the place.
std::string error_text(const config::RobotConfig& robot, std::size_t joint, std::uint32_t code);
// "takt joint home elbow --robot robot.yaml --at ANGLE"
std::string home_command(const config::RobotConfig& robot, std::size_t joint);

}  // namespace takt::drivers
