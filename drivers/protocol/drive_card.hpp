// SPDX-License-Identifier: Apache-2.0
// The drive card: what a drive said of itself while it was set up, beside what the robot file says. Read from the
// frames that drivers and drives exchange anyway; nothing is asked for here, and nothing decides by it. What a drive
// does not tell stays unknown, and is never a 0 or a default.
// Thread rule: one thread at a time, any but the control thread (it allocates).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/protocol/drive_words.hpp"

namespace takt::drivers {

enum class CardItem : std::uint8_t {
  identity,
  hardware,
  firmware,
  mode,
  position_range,
  velocity_range,
  torque_range,
  velocity_unit,
  following_window,
  watchdog,
  home,
  scale  // by a person's eye: no drive tells it
};
std::string_view name(CardItem item);

enum class CardVerdict : std::uint8_t {
  told,     // the robot file says nothing about it
  agrees,   // with the robot file, or with what Takt needs
  differs,  // such a drive is not armed
  waived,   // unknown or wrong, and the robot file waives it
  unknown,  // not told (yet)
};
std::string_view name(CardVerdict verdict);

struct CardEntry {
  CardItem item = CardItem::identity;
  std::string source;    // "register 14"; empty: the protocol has no way to tell it
  std::string value;     // empty: unknown
  std::string expected;  // empty: nothing is expected
  CardVerdict verdict = CardVerdict::unknown;
};

// One setting as the drive told it: key is the protocol's number of it.
struct ToldSetting {
  std::uint32_t key = 0, value = 0;
};
struct ToldSettings {
  std::array<ToldSetting, 16> settings{};
  std::size_t count = 0;
  std::uint32_t progress = 0;  // the protocol's own, kept from frame to frame of one drive; 0 at first
  void add(std::uint32_t key, std::uint32_t value) {
    if (count < settings.size()) settings[count++] = {key, value};
  }
};

// What a protocol can say about an item. Of several rows about one item those that were told count, else the first; one
// that says `instead` counts only where none before it was told.
struct CardRow {
  CardItem item = CardItem::identity;
  std::string source;
  std::string expected;
  std::vector<std::uint32_t> keys;  // all of them must be told; none and a text: known from the start
  bool instead = false;
  // Of the keys' values, in their order; unset: it cannot be told.
  std::function<std::string(std::span<const std::uint32_t>)> text{};
  // Unset: agrees where nothing else is expected than the text, differs where another is.
  std::function<bool(std::span<const std::uint32_t>)> fits{};
};

class DriveCard {
 public:
  // Precondition: a joint of the robot's, whose protocol this build speaks.
  DriveCard(const config::RobotConfig& robot, std::size_t joint);
  // A frame that arrived on the joint's bus. True: the card says more or something else now.
  bool take(const CanFrame& frame);
  [[nodiscard]] std::vector<CardEntry> entries() const;

 private:
  [[nodiscard]] CardEntry entry_of(const CardRow& row) const;
  [[nodiscard]] bool was_told(const CardRow& row) const;

  config::Drive drive_;
  std::vector<CardRow> rows_;
  std::map<std::uint32_t, std::uint32_t> told_;
  std::uint32_t progress_ = 0;
};

// --- for protocols' rows ---

CardRow untold(CardItem item);
// The number a drive says; `expected` as the robot file writes it ("any": nothing).
CardRow words_row(CardItem item, std::string source, std::vector<std::uint32_t> keys, WordStyle style,
                  const DriveWords& expected);
// A float32 of the drive, compared to a millionth.
CardRow range_row(CardItem item, std::string source, std::uint32_t key, double expected, const char* unit);
// A time-out in units of `unit`, which must be on and one second at most.
CardRow watchdog_row(std::string source, std::uint32_t key, Duration unit);

}  // namespace takt::drivers
