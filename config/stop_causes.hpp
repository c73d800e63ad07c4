// SPDX-License-Identifier: Apache-2.0
// The causes that `stops` of a robot file may name: those that the executive's table answers with a damped stop
// (executive/setup/tick_config_of.cpp asserts that the two agree).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

#include "executive/contract/mode.hpp"

namespace takt::config {

inline constexpr auto kStopCauses = [] {
  constexpr auto kDamping = std::ranges::count_if(kCauseFacts, &CauseFacts::damps);
  std::array<Cause, kDamping> causes{};
  std::size_t count = 0;
  for (const CauseFacts& row : kCauseFacts)
    if (row.damps) causes[count++] = row.cause;
  return causes;
}();

// Those of them that may leave the robot to its fallback policy: what makes them hurts neither drives nor feedback, nor
// what that policy sees, and none of them is worse than a person's stop.
inline constexpr std::array kPolicyStopCauses{Cause::operator_stop, Cause::bad_commands, Cause::overrun};

// Cause::none: no such cause.
constexpr Cause stop_cause_named(std::string_view word) {
  const auto found = std::ranges::find_if(kStopCauses, [&](Cause cause) { return name(cause) == word; });
  return found == kStopCauses.end() ? Cause::none : *found;
}

}  // namespace takt::config
