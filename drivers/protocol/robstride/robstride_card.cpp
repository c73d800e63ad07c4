// SPDX-License-Identifier: Apache-2.0
// What a RobStride drive's card has: its unique id (type 0) and parameters (type 17).
#include "drivers/protocol/drive_timeout.hpp"
#include "drivers/protocol/robstride/robstride_driver.hpp"

namespace takt::drivers {
namespace {

// Beyond every parameter's index.
constexpr std::uint32_t kFirstOfId = 0x1'0000, kSecondOfId = 0x1'0001;

constexpr std::uint32_t key(RobstrideParameter which) {
  return static_cast<std::uint32_t>(which);
}

CardRow robstride_mode_row() {
  return {.item = CardItem::mode,
          .source = "parameter 7005",
          .expected = "0 (motion)",
          .keys = {key(RobstrideParameter::run_mode)},
          .text = [](std::span<const std::uint32_t> values) {
            return std::to_string(values[0]) + (values[0] == 0 ? " (motion)" : "");
          }};
}

CardRow home_row(const config::Joint& joint) {
  if (joint.drive.model == "CyberGear") return untold(CardItem::home);
  CardRow row{.item = CardItem::home,
              .source = "parameter 7029",
              .expected = begins_below_zero(joint) ? "1 (-pi to pi)" : "",
              .keys = {key(RobstrideParameter::zero_state)},
              .text = [](std::span<const std::uint32_t> values) {
                return values[0] == 0 ? "0 (0 to 2 pi)" : values[0] == 1 ? "1 (-pi to pi)" : std::to_string(values[0]);
              }};
  return row;
}

}  // namespace

std::vector<CardRow> robstride_card_rows(const config::RobotConfig& robot, std::size_t joint) {
  using enum CardItem;
  const config::Drive& drive = robot.joints.at(joint).drive;
  const auto expected = words_of("", drive.identity, {.style = WordStyle::hex, .least = 2, .most = 2});
  return {words_row(identity, "unique id, type 0", {kFirstOfId, kSecondOfId}, WordStyle::hex,
                    expected.value_or(DriveWords{})),
          untold(hardware),
          untold(firmware),
          robstride_mode_row(),
          untold(position_range),
          untold(velocity_range),
          untold(torque_range),
          watchdog_row("parameter 7028", key(RobstrideParameter::can_timeout), kTimeoutUnit),
          watchdog_row("parameter 200C", key(RobstrideParameter::stored_timeout), kTimeoutUnit),
          home_row(robot.joints.at(joint))};
}

void robstride_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told) {
  const RobstrideAddress address{static_cast<std::uint8_t>(drive.id), static_cast<std::uint8_t>(drive.host_id)};
  const auto kind = robstride_kind(address, frame);
  if (kind == RobstrideKind::identity) {
    if (const auto identity = decode_robstride_identity(frame)) {
      told.add(kFirstOfId, identity->first);
      told.add(kSecondOfId, identity->second);
    }
  } else if (kind == RobstrideKind::answer) {
    if (const auto answer = decode_robstride_answer(frame); answer && !answer->failed)
      told.add(answer->index, answer->value);
  }
}

}  // namespace takt::drivers
