// SPDX-License-Identifier: Apache-2.0
// What a moteus' card has: its registers. Its watchdog is in every command, so there is nothing to read.
#include "drivers/protocol/moteus/moteus_driver.hpp"

namespace takt::drivers {
namespace {

constexpr std::uint32_t kHome = 0x00C, kModel = 0x100, kFirmwareVersion = 0x101, kSerialNumber = 0x120;

CardRow watchdog_in_commands() {
  return {.item = CardItem::watchdog,
          .source = "register 027",
          .expected = "in every command",
          .keys = {},
          .text = [](std::span<const std::uint32_t>) { return std::string("in every command"); }};
}

CardRow home_row() {
  constexpr std::uint32_t kOutput = 2;
  return {.item = CardItem::home,
          .source = "register 00C",
          .expected = "2 (referenced to the output)",
          .keys = {kHome},
          .text = [](std::span<const std::uint32_t> values) {
            static constexpr std::array<const char*, 3> kMeaning{" (relative)", " (referenced to the rotor)",
                                                                 " (referenced to the output)"};
            return std::to_string(values[0]) + (values[0] <= kOutput ? kMeaning[values[0]] : "");
          }};
}

}  // namespace

std::vector<CardRow> moteus_card_rows(const config::RobotConfig& robot, std::size_t joint) {
  using enum CardItem;
  const config::Drive& drive = robot.joints.at(joint).drive;
  const auto serial = words_of("", drive.identity, {.style = WordStyle::hex, .least = 3, .most = 3});
  const auto version = words_of("", drive.firmware, {.style = WordStyle::version});
  return {words_row(identity, "registers 120 to 122", {kSerialNumber, kSerialNumber + 1, kSerialNumber + 2},
                    WordStyle::hex, serial.value_or(DriveWords{})),
          words_row(hardware, "register 100", {kModel}, WordStyle::hex, {}),
          words_row(firmware, "register 101", {kFirmwareVersion}, WordStyle::version, version.value_or(DriveWords{})),
          untold(mode),
          untold(torque_range),
          watchdog_in_commands(),
          home_row()};
}

void moteus_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told) {
  if (frame.id != drive.id << 8U) return;
  const MoteusFacts facts = decode_moteus_facts(frame);
  if (facts.model) told.add(kModel, *facts.model);
  if (facts.firmware) told.add(kFirmwareVersion, facts.firmware->word[0]);
  if (facts.home) told.add(kHome, *facts.home);
  for (std::uint32_t i = 0; facts.serial_number && i < 3; ++i)
    told.add(kSerialNumber + i, facts.serial_number->word[i]);
}

}  // namespace takt::drivers
