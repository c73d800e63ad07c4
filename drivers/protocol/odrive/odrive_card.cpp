// SPDX-License-Identifier: Apache-2.0
// What an ODrive's card has: its versions (message 00). What its watchdog is, its parameters alone would tell.
#include "drivers/protocol/odrive/odrive_driver.hpp"

namespace takt::drivers {
namespace {

constexpr std::uint32_t kHardwareMessage = 0, kFirmwareMessage = 1;

}  // namespace

std::vector<CardRow> odrive_card_rows(const config::RobotConfig& robot, std::size_t joint) {
  using enum CardItem;
  const auto expected = words_of("", robot.joints.at(joint).drive.firmware, {.style = WordStyle::version});
  return {untold(identity),
          words_row(hardware, "message 00", {kHardwareMessage}, WordStyle::version, {}),
          words_row(firmware, "message 00", {kFirmwareMessage}, WordStyle::version, expected.value_or(DriveWords{})),
          untold(mode),
          untold(torque_range),
          untold(watchdog),
          untold(home)};
}

void odrive_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told) {
  const auto version = decode_odrive_version(drive.id, frame);
  if (!version) return;
  told.add(kHardwareMessage, version->hardware);
  told.add(kFirmwareMessage, version->firmware);
}

}  // namespace takt::drivers
