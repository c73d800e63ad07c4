// SPDX-License-Identifier: Apache-2.0
// Bits that say what the executive changed about a joint's command in one tick, one mask per joint.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt {

enum class Intervention : std::uint16_t {
  position_limit = 1U << 0U,      // reference clamped to the position limits
  braking_distance = 1U << 1U,    // reference velocity cut so that the joint can still stop before its limit
  velocity_limit = 1U << 2U,      // reference velocity clamped
  acceleration_limit = 1U << 3U,  // reference acceleration clamped
  position_barrier = 1U << 4U,    // torque changed by the barrier on the measured position
  velocity_barrier = 1U << 5U,    // torque changed by the barrier on the measured velocity
  torque_limit = 1U << 6U,        // torque clamped
  torque_rate_limit = 1U << 7U,   // torque slew clamped
  gain_limit = 1U << 8U,          // requested kp or kd clamped
  envelope_clamp = 1U << 9U,      // the last clamp before encoding had to act: one of the above missed something
  target_range = 1U << 10U,       // the policy's target lay outside the joint's range: clamped, and counted
  brake_reserve = 1U << 11U,      // reference slowed or braked: beyond this the torque left would not stop it in time
};
inline constexpr std::size_t kInterventionCount = 12;

using InterventionMask = std::uint16_t;

constexpr InterventionMask bit(Intervention intervention) {
  return static_cast<InterventionMask>(intervention);
}

inline constexpr std::array<std::string_view, kInterventionCount> kInterventionNames{
    "position_limit",   "braking_distance", "velocity_limit", "acceleration_limit",
    "position_barrier", "velocity_barrier", "torque_limit",   "torque_rate_limit",
    "gain_limit",       "envelope_clamp",   "target_range",   "brake_reserve"};

}  // namespace takt
