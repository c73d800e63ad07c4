// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/drive_card.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <utility>

#include "drivers/protocol/drive_timeout.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {
namespace {

std::string digits(double number, const char* unit) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%.6g %s", number, unit);
  return text.data();
}

}  // namespace

std::string_view name(CardItem item) {
  switch (item) {
    case CardItem::identity:
      return "identity";
    case CardItem::hardware:
      return "hardware";
    case CardItem::firmware:
      return "firmware";
    case CardItem::mode:
      return "mode";
    case CardItem::position_range:
      return "position_range";
    case CardItem::velocity_range:
      return "velocity_range";
    case CardItem::torque_range:
      return "torque_range";
    case CardItem::velocity_unit:
      return "velocity_unit";
    case CardItem::following_window:
      return "following_window";
    case CardItem::watchdog:
      return "watchdog";
    case CardItem::home:
      return "home";
    case CardItem::scale:
      return "scale";
  }
  return "invalid";
}

std::string_view name(CardVerdict verdict) {
  switch (verdict) {
    case CardVerdict::told:
      return "told";
    case CardVerdict::agrees:
      return "agrees";
    case CardVerdict::differs:
      return "differs";
    case CardVerdict::waived:
      return "waived";
    case CardVerdict::unknown:
      return "unknown";
  }
  return "invalid";
}

DriveCard::DriveCard(const config::RobotConfig& robot, std::size_t joint) : drive_(robot.joints.at(joint).drive) {
  if (const Protocol* const protocol = find_protocol(drive_.protocol)) rows_ = protocol->card_rows(robot, joint);
}

bool DriveCard::take(const CanFrame& frame) {
  const Protocol* const protocol = find_protocol(drive_.protocol);
  if (protocol == nullptr) return false;
  ToldSettings told;
  told.progress = progress_;
  protocol->settings_told(drive_, frame, told);
  progress_ = told.progress;
  bool changed = false;
  for (const ToldSetting& one : std::span(told.settings).first(told.count)) {
    const auto [place, is_new] = told_.try_emplace(one.key, one.value);
    changed |= is_new || std::exchange(place->second, one.value) != one.value;
  }
  return changed;
}

bool DriveCard::was_told(const CardRow& row) const {
  return row.text && std::ranges::all_of(row.keys, [this](std::uint32_t key) { return told_.contains(key); });
}

CardEntry DriveCard::entry_of(const CardRow& row) const {
  CardEntry entry{row.item, row.source, {}, row.expected, CardVerdict::unknown};
  if (was_told(row)) {
    std::vector<std::uint32_t> values;
    for (const std::uint32_t key : row.keys) values.push_back(told_.at(key));
    entry.value = row.text(values);
    const bool compared = row.fits || !row.expected.empty();
    const bool fits = row.fits ? row.fits(values) : entry.value == row.expected;
    entry.verdict = !compared ? CardVerdict::told : fits ? CardVerdict::agrees : CardVerdict::differs;
  }
  const bool settled = entry.verdict == CardVerdict::agrees || entry.verdict == CardVerdict::told;
  if (row.item == CardItem::watchdog && !settled && config::waives_watchdog(drive_))
    entry.verdict = CardVerdict::waived;
  return entry;
}

std::vector<CardEntry> DriveCard::entries() const {
  std::vector<CardEntry> entries;
  for (auto row = rows_.begin(); row != rows_.end();) {
    const auto end = std::find_if(row, rows_.end(), [&](const CardRow& one) { return one.item != row->item; });
    const bool any_told = std::any_of(row, end, [this](const CardRow& one) { return was_told(one); });
    if (!any_told) entries.push_back(entry_of(*row));
    for (bool told = false; row != end; ++row) {
      if (!was_told(*row) || (row->instead && told)) continue;
      entries.push_back(entry_of(*row));
      told = true;
    }
  }
  return entries;
}

CardRow untold(CardItem item) {
  return {.item = item, .source = {}, .expected = {}, .keys = {}};
}

CardRow words_row(CardItem item, std::string source, std::vector<std::uint32_t> keys, WordStyle style,
                  const DriveWords& expected) {
  const auto told = [](std::span<const std::uint32_t> values) {
    DriveWords words;
    for (const std::uint32_t value : values) words.word[words.count++] = value;
    return words;
  };
  CardRow row{.item = item,
              .source = std::move(source),
              .expected = text_of(expected, style),
              .keys = std::move(keys),
              .text = [told, style](std::span<const std::uint32_t> values) { return text_of(told(values), style); }};
  if (expected.count != 0)
    row.fits = [told, expected](std::span<const std::uint32_t> values) { return agrees(expected, told(values)); };
  return row;
}

CardRow range_row(CardItem item, std::string source, std::uint32_t key, double expected, const char* unit) {
  constexpr double kSameWithin = 1e-6;
  const auto number = [](std::span<const std::uint32_t> values) { return double{std::bit_cast<float>(values[0])}; };
  return {.item = item,
          .source = std::move(source),
          .expected = digits(expected, unit),
          .keys = {key},
          .text = [=](std::span<const std::uint32_t> values) { return digits(number(values), unit); },
          .fits =
              [=](std::span<const std::uint32_t> values) {
                return std::abs(number(values) - double{static_cast<float>(expected)}) <= kSameWithin * expected;
              }};
}

CardRow watchdog_row(std::string source, std::uint32_t key, Duration unit) {
  const auto span = [unit](std::span<const std::uint32_t> values) { return unit * values[0]; };
  return {.item = CardItem::watchdog,
          .source = std::move(source),
          .expected = "at most " + digits(kLongestDriveTimeout.milliseconds(), "ms"),
          .keys = {key},
          .text =
              [span](std::span<const std::uint32_t> values) {
                return values[0] == 0 ? "off" : digits(span(values).milliseconds(), "ms");
              },
          .fits =
              [span](std::span<const std::uint32_t> values) {
                return values[0] != 0 && span(values) <= kLongestDriveTimeout;
              }};
}

}  // namespace takt::drivers
