// SPDX-License-Identifier: Apache-2.0
// Joint-space vectors whose unit is part of the type, and the fixed capacities every process agrees on.
//
// A JointVector always has room for kMaxJoints; how many entries are in use is said by the joint count of the
// structure around it. Entries beyond that count are zero. Values are float32: drives resolve 16 bits or fewer.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "executive/contract/layout.hpp"

namespace takt {

inline constexpr std::size_t kMaxJoints = 64;
inline constexpr std::size_t kMaxChunkSteps = 128;
inline constexpr std::size_t kMaxBuses = 16;
inline constexpr std::size_t kMaxSensorValues = 256;
inline constexpr std::size_t kMaxSensorQueue = 128;  // samples

using JointMask = std::uint64_t;  // bit j: joint j
static_assert(kMaxJoints <= 64);

constexpr JointMask bit_of_joint(std::size_t joint) {
  return JointMask{1} << joint;
}
constexpr JointMask every_joint(std::uint32_t count) {
  return count >= 64 ? ~JointMask{0} : (JointMask{1} << count) - 1;
}

// In which ticks a joint's drive is written to: every n-th.
struct Turns {
  std::uint8_t every = 1;  // >= 1
  std::uint8_t phase = 0;  // < every
  [[nodiscard]] constexpr bool has(std::uint64_t tick) const { return every <= 1 || tick % every == phase; }
};

namespace unit {
struct Radian;                   // joint position
struct RadianPerSecond;          // joint velocity
struct NewtonMetre;              // joint torque
struct NewtonMetrePerRadian;     // stiffness, kp
struct NewtonMetreSecondPerRad;  // damping, kd
}  // namespace unit

template <class Unit>
struct JointVector {
  std::array<float, kMaxJoints> at{};
  constexpr float& operator[](std::size_t joint) { return at[joint]; }
  constexpr float operator[](std::size_t joint) const { return at[joint]; }
};
template <class Unit>
constexpr auto fields_of(Shared<JointVector<Unit>>) {
  using Of = JointVector<Unit>;
  return std::array{
      TAKT_FIELD(at),
  };
}

using Positions = JointVector<unit::Radian>;
using Velocities = JointVector<unit::RadianPerSecond>;
using Torques = JointVector<unit::NewtonMetre>;
using Stiffnesses = JointVector<unit::NewtonMetrePerRadian>;
using Dampings = JointVector<unit::NewtonMetreSecondPerRad>;

static_assert(std::is_standard_layout_v<Positions> && sizeof(Positions) == 4 * kMaxJoints);

}  // namespace takt
