// SPDX-License-Identifier: Apache-2.0
// Bytes to numbers, and motor side to joint side, for this room alone.
#pragma once

#include <bit>
#include <cstdint>

#include "drivers/bus/can_bus.hpp"
#include "drivers/guard/joint_facts.hpp"

namespace takt::drivers::guard {

inline bool is_classic(const CanFrame& frame, bool extended, std::uint8_t length) noexcept {
  return frame.extended == extended && !frame.fd && !frame.remote && !frame.error && frame.length == length;
}

// The same eight bytes as CAN FD has them, at the faster rate.
inline bool is_fd(const CanFrame& frame, std::uint8_t length) noexcept {
  return !frame.extended && frame.fd && frame.bit_rate_switch && !frame.remote && !frame.error &&
         frame.length == length;
}

inline std::uint32_t little16(const std::uint8_t* at) noexcept {
  return at[0] | std::uint32_t{at[1]} << 8U;
}
inline std::uint32_t little32(const std::uint8_t* at) noexcept {
  return little16(at) | little16(at + 2) << 16U;
}
inline float little_float(const std::uint8_t* at) noexcept {
  return std::bit_cast<float>(little32(at));
}
inline std::uint32_t big16(const std::uint8_t* at) noexcept {
  return std::uint32_t{at[0]} << 8U | at[1];
}
inline void write_little32(std::uint8_t* at, std::uint32_t value) noexcept {
  for (unsigned i = 0; i < 4; ++i) at[i] = static_cast<std::uint8_t>(value >> 8 * i & 0xFFU);
}
inline void write_little_float(std::uint8_t* at, float value) noexcept {
  write_little32(at, std::bit_cast<std::uint32_t>(value));
}

// A drive's own time-out as Damiao and RobStride count it, in units of 50 us: on, and one second at most.
inline bool is_timeout(std::uint32_t units) noexcept {
  return units > 0 && units <= 20'000;
}

// A code's share of its field.
inline float share(std::uint32_t code, float top) noexcept {
  return static_cast<float>(code) / top;
}
inline float two_sided(float share_of_field, float range) noexcept {
  return (2 * share_of_field - 1) * range;
}

// From the motor's side of the gear to the joint's.
inline Motion to_joint(const JointFacts& facts, const Motion& motor) noexcept {
  const float squared = facts.ratio * facts.ratio;
  return {motor.q / facts.ratio + facts.offset, motor.dq / facts.ratio, motor.kp * squared, motor.kd * squared,
          motor.tau * facts.ratio};
}

}  // namespace takt::drivers::guard
