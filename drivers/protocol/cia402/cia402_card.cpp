// SPDX-License-Identifier: Apache-2.0
// What a CiA 402 drive's card has: the objects that its set-up reads.
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "config/joint_units.hpp"
#include "drivers/protocol/cia402/cia402_driver.hpp"
#include "drivers/protocol/drive_timeout.hpp"

namespace takt::drivers {
namespace {

constexpr std::uint32_t key(std::uint32_t index, std::uint32_t sub) {
  return index << 8U | sub;
}
constexpr std::uint32_t kVendor = key(0x1018, 1), kProduct = key(0x1018, 2), kRevision = key(0x1018, 3),
                        kSerial = key(0x1018, 4), kDeadline = key(0x1400, 5), kHeartbeatWatch = key(0x1016, 1),
                        kMode = key(0x6061, 0), kRatedTorque = key(0x6076, 0), kMaxTorque = key(0x6072, 0),
                        kVelocityUnit = key(0x60A9, 0), kFollowingWindow = key(0x6065, 0),
                        kFollowingTimeout = key(0x6066, 0);

// Of the text's segments two words each: four letters, and three.
constexpr std::uint32_t kTextWords = 2 * cia402::kTextSegments;
constexpr std::uint32_t text_word(std::uint32_t i) {
  return key(0x100A, i);
}

CardRow text_row() {
  CardRow row{.item = CardItem::firmware, .source = "object 100A:00", .expected = {}, .keys = {}};
  for (std::uint32_t i = 0; i < kTextWords; ++i) row.keys.push_back(text_word(i));
  row.text = [](std::span<const std::uint32_t> words) {
    std::string text;
    for (std::size_t i = 0; i < words.size(); ++i)
      for (unsigned letter = 0; letter < 4; ++letter)
        if (const auto c = static_cast<char>(words[i] >> 8 * letter & 0x7FU); c != 0)
          text += c >= ' ' && c <= '~' ? c : '?';
    return text;
  };
  return row;
}

// What the text consists of; `told.progress` is the number of segments so far, and 1; 0: none is coming.
void tell_segment(const cia402::SdoSegment& segment, ToldSettings& told) {
  if (told.progress == 0 || segment.toggle != (told.progress % 2 == 0)) return;
  const std::uint32_t first = 2 * (told.progress - 1);
  const auto& b = segment.bytes;
  const auto word = [&b](std::size_t from, std::size_t count) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value |= std::uint32_t{b.at(from + i)} << 8 * i;
    return value;
  };
  told.add(text_word(first), word(0, 4));
  told.add(text_word(first + 1), word(4, 3));
  ++told.progress;
  if (!segment.last && told.progress <= cia402::kTextSegments) return;
  for (std::uint32_t i = first + 2; i < kTextWords; ++i) told.add(text_word(i), 0);
  told.progress = 0;
}

// "8 (csp)"
std::string mode_text(std::uint32_t mode) {
  static constexpr std::array<const char*, 3> kFrom8{" (csp)", " (csv)", " (cst)"};
  return std::to_string(mode) + (mode >= 8 && mode - 8 < kFrom8.size() ? kFrom8[mode - 8] : "");
}

CardRow cia402_mode_row(config::Cia402Mode mode) {
  return {.item = CardItem::mode,
          .source = "object 6061:00",
          .expected = mode_text(mode == config::Cia402Mode::csp   ? 8
                                : mode == config::Cia402Mode::csv ? 9
                                                                  : 10),
          .keys = {kMode},
          .text = [](std::span<const std::uint32_t> values) { return mode_text(values[0]); }};
}

// What the drive calls its rated torque, and the most that it lets through.
std::vector<CardRow> torque_rows(const config::Drive& drive) {
  const auto newton_metres = [](double torque) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "rated %.6g Nm", torque);
    return std::string(text.data());
  };
  const auto rated_mNm = static_cast<double>(drive.rated_torque) * 1000;
  return {
      {.item = CardItem::torque_range,
       .source = "object 6076:00",
       .expected = newton_metres(drive.rated_torque),
       .keys = {kRatedTorque},
       .text = [=](std::span<const std::uint32_t> values) { return newton_metres(values[0] / 1000.0); },
       .fits =
           [=](std::span<const std::uint32_t> values) { return std::abs(values[0] - rated_mNm) * 200 <= rated_mNm; }},
      {.item = CardItem::torque_range,
       .source = "object 6072:00",
       .expected = {},
       .keys = {kMaxTorque},
       .text = [](std::span<const std::uint32_t> values) {
         return "at most " + std::to_string(values[0]) + " per mille of it";
       }}};
}

// How far from its target, and for how long, the drive lets its motor be before it faults.
CardRow following_row(const config::Joint& joint) {
  const config::Drive& drive = joint.drive;
  constexpr std::uint32_t kNone = 0xFFFF'FFFF;
  const double per_count = 2 * std::numbers::pi / static_cast<double>(drive.counts_per_turn) / drive.gear_ratio;
  const char* const unit = config::kJointPosition.unit(joint.kind).data();
  return {.item = CardItem::following_window,
          .source = "objects 6065:00, 6066:00",
          .expected = {},
          .keys = {kFollowingWindow, kFollowingTimeout},
          .text = [=](std::span<const std::uint32_t> values) {
            if (values[0] == kNone) return std::string("none: the drive does not watch it");
            std::array<char, 80> text{};
            std::snprintf(text.data(), text.size(), "%.3g %s for %u ms", values[0] * per_count, unit, values[1]);
            return std::string(text.data());
          }};
}

CardRow unit_row() {
  return {.item = CardItem::velocity_unit,
          .source = "object 60A9:00",
          .expected = {},
          .keys = {kVelocityUnit},
          .text = [](std::span<const std::uint32_t> values) {
            return text_of({{values[0]}, 1}, WordStyle::hex);
          }};
}

}  // namespace

std::vector<CardRow> cia402_card_rows(const config::RobotConfig& robot, std::size_t joint) {
  using enum CardItem;
  const config::Drive& drive = robot.joints.at(joint).drive;
  const auto named =
      words_of("", drive.identity, {.style = WordStyle::hex, .least = 2, .most = 3}).value_or(DriveWords{});
  const auto revision = words_of("", drive.firmware, {.style = WordStyle::hex}).value_or(DriveWords{});
  CardRow without_serial = words_row(identity, "object 1018:01, 02", {kVendor, kProduct}, WordStyle::hex, named);
  without_serial.instead = true;
  std::vector<CardRow> rows{
      words_row(identity, "object 1018:01, 02, 04", {kVendor, kProduct, kSerial}, WordStyle::hex, named),
      std::move(without_serial),
      untold(hardware),
      words_row(firmware, "object 1018:03", {kRevision}, WordStyle::hex, revision),
      text_row(),
      cia402_mode_row(drive.mode)};
  for (CardRow& row : torque_rows(drive)) rows.push_back(std::move(row));
  if (drive.mode == config::Cia402Mode::csv) rows.push_back(unit_row());
  if (drive.mode == config::Cia402Mode::csp) rows.push_back(following_row(robot.joints[joint]));
  rows.push_back(watchdog_row("object 1400:05", kDeadline, milliseconds(1)));
  rows.push_back(watchdog_row("object 1016:01", kHeartbeatWatch, milliseconds(1)));
  rows.push_back(untold(home));
  return rows;
}

void cia402_settings_told(const config::Drive& drive, const CanFrame& frame, ToldSettings& told) {
  if (frame.id != cia402::kSdoAnswerId + drive.id || frame.extended || frame.fd || frame.remote) return;
  if (const auto segment = cia402::decode_sdo_segment(frame)) return tell_segment(*segment, told);
  const auto answer = cia402::decode_sdo_answer(frame);
  told.progress = 0;
  if (answer && answer->object == cia402::ObjectId{0x100A, 0}) {
    if (answer->kind == cia402::SdoAnswer::Kind::segmented) told.progress = 1;
    if (answer->kind != cia402::SdoAnswer::Kind::value) return;
    told.add(text_word(0), answer->value);
    for (std::uint32_t i = 1; i < kTextWords; ++i) told.add(text_word(i), 0);
    return;
  }
  if (!answer || answer->kind != cia402::SdoAnswer::Kind::value) return;
  const std::uint32_t which = key(answer->object.index, answer->object.sub);
  // The upper half says whose heartbeat is watched.
  told.add(which, which == kHeartbeatWatch ? answer->value & 0xFFFFU : answer->value);
}

}  // namespace takt::drivers
