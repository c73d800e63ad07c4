// SPDX-License-Identifier: Apache-2.0
// What the last guard said of a joint's frames in one tick: the first that it refused, if it refused any. Why each rule
// holds and how exactly it is judged: drivers/guard/wire_guard.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt {

enum class WireVerdict : std::uint8_t {
  allowed,
  unknown_frame,  // not the joint's drive's, or nothing that we ever say
  misplaced,      // would drive one that is to be off, or change the settings of one that is to be on
  not_finite,
  gain,           // stiffness or damping outside its limit
  expired,        // would push after the instant until which the tick's decision may be obeyed
  feedback_lost,  // would push a joint that has been silent for too long
  position,       // outside the limits and their margin
  velocity,       // beyond the limit, or a position further from the last than a period at the limit
  torque,         // beyond the limit at the tick's estimate
  slew,           // further from the last torque than one period allows
  differs,        // inside every limit, and not what the tick decided
};
inline constexpr std::size_t kWireVerdictCount = 12;

inline constexpr std::array<std::string_view, kWireVerdictCount> kWireVerdictNames{
    "allowed",       "unknown_frame", "misplaced", "not_finite", "gain", "expired",
    "feedback_lost", "position",      "velocity",  "torque",     "slew", "differs"};

// Time may pass between the last look at the clock and a frame's turn: a frame refused for that alone is no bug.
constexpr bool is_bug(WireVerdict verdict) {
  return verdict != WireVerdict::allowed && verdict != WireVerdict::expired;
}

}  // namespace takt
