// SPDX-License-Identifier: Apache-2.0
// What an MIT drive's card has: of a Damiao drive its registers, of a T-Motor drive nothing, which tells nothing.
#include "drivers/protocol/drive_timeout.hpp"
#include "drivers/protocol/mit/mit_driver.hpp"

namespace takt::drivers {
namespace {

constexpr std::uint32_t key(DamiaoRegister which) {
  return static_cast<std::uint32_t>(which);
}

CardRow number_row(CardItem item, const char* source, DamiaoRegister which, const std::string& expected) {
  const auto words = words_of("", expected, {.style = WordStyle::decimal});
  return words_row(item, source, {key(which)}, WordStyle::decimal, words.value_or(DriveWords{}));
}

CardRow mit_mode_row() {
  constexpr std::uint32_t kMitMode = 1;
  return {.item = CardItem::mode,
          .source = "register 10",
          .expected = "1 (MIT)",
          .keys = {key(DamiaoRegister::control_mode)},
          .text = [](std::span<const std::uint32_t> values) {
            return std::to_string(values[0]) + (values[0] == kMitMode ? " (MIT)" : "");
          }};
}

}  // namespace

std::vector<CardRow> mit_card_rows(const config::RobotConfig& robot, std::size_t joint) {
  using enum CardItem;
  const config::Drive& drive = robot.joints.at(joint).drive;
  if (drive.variant != "damiao")
    return {untold(identity),       untold(hardware),     untold(firmware), untold(mode), untold(position_range),
            untold(velocity_range), untold(torque_range), untold(watchdog), untold(home)};
  return {number_row(identity, "register 15", DamiaoRegister::serial_number, drive.identity),
          number_row(hardware, "register 13", DamiaoRegister::hardware, {}),
          number_row(firmware, "register 14", DamiaoRegister::firmware, drive.firmware),
          mit_mode_row(),
          range_row(position_range, "register 21", key(DamiaoRegister::p_max), drive.position_range, "rad"),
          range_row(velocity_range, "register 22", key(DamiaoRegister::v_max), drive.velocity_range, "rad/s"),
          range_row(torque_range, "register 23", key(DamiaoRegister::t_max), drive.torque_range, "Nm"),
          watchdog_row("register 9", key(DamiaoRegister::timeout), kTimeoutUnit),
          untold(home)};
}

void mit_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told) {
  if (drive.variant != "damiao" || frame.id != drive.reply_id) return;
  if (const auto answer = decode_damiao_answer(drive.id, frame, drive.fd_bitrate != 0); answer && answer->to_question)
    told.add(key(answer->which), answer->value);
}

}  // namespace takt::drivers
