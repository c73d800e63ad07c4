// SPDX-License-Identifier: Apache-2.0
// What is told of a tick: each fact's one name, that of its field in the run's ticks, and its value. `--json` and ROS
// 2's diagnostics are made of it, and /takt/status has the same names. Pure; lists of names
// allocate: not for the control thread.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "executive/contract/tick_record.hpp"

namespace takt {

// None: the seat has no command in use.
constexpr std::optional<Duration> age_of(const SeatRecord& seat) {
  return seat.freshness == Freshness::missing ? std::nullopt : std::optional(seat.age);
}
// Of the command that the robot follows; none: it follows none.
constexpr std::optional<Duration> age_of_played(const TickRecordHeader& tick) {
  if (tick.player == Player::policy) return tick.age.total();
  const std::optional<Seat> seat = seat_of(tick.player);
  if (!seat || static_cast<std::size_t>(tick.player) >= kMoverCount) return std::nullopt;
  return tick.seats[*seat].age;
}

// The tick counts in the freshness contract.
constexpr bool relies_on_policy(const TickRecordHeader& tick) {
  return tick.previous_mode == Mode::tracking || tick.previous_mode == Mode::degraded;
}

constexpr double window_miss_share(const TickRecordHeader& tick) {
  return tick.window_ticks == 0 ? 0.0 : static_cast<double>(tick.window_misses) / tick.window_ticks;
}

// Of those that hold in this tick.
inline std::vector<std::string_view> names_of_active_causes(const TickRecordHeader& tick) {
  std::vector<std::string_view> names;
  for (std::size_t cause = 1; cause < kCauseCount; ++cause)
    if ((tick.causes_active >> cause & 1U) != 0) names.push_back(name(static_cast<Cause>(cause)));
  return names;
}

// A policy by the first 8 bytes of its SHA-256; 0: none.
struct PolicyHash {
  std::uint64_t value = 0;
};

// Calls tell(name, value). A value is text, a flag, a count, a list of texts, a PolicyHash, or an optional Duration.
template <class Tell>
void tell_facts(const TickRecordHeader& tick, Tell&& tell) {
  const SeatRecord& policy = tick.seats[Seat::policy];
  tell("tick", tick.tick);
  tell("mode", name(tick.mode));
  tell("player", name(tick.player));
  tell("freshness", name(policy.freshness));
  tell("age", age_of(policy));
  tell("command_policy", PolicyHash{tick.command_policy});
  tell("window_misses", tick.window_misses);
  tell("window_ticks", tick.window_ticks);
  tell("skipped_periods", tick.skipped_periods);
  tell("refused_commands", tick.refused_commands);
  tell("integration_errors", tick.integration_errors);
  tell("drives_enabled", tick.drives_enabled != 0);
  tell("causes_active", names_of_active_causes(tick));
  tell("recorded_through", tick.recorded_through);
}

}  // namespace takt
