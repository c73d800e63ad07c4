// SPDX-License-Identifier: Apache-2.0
// One sample of the inertial measurement unit in the robot's base, as its process publishes it (ten values of a
// SensorSample, in this order), and what the tick concludes about it.
//
// Frames: the base frame is the robot's own, as its model has it; the world frame's z points up.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

inline constexpr std::size_t kImuValues = 10;

struct ImuSample {
  std::uint64_t sequence = 0;        // 1, 2, 3, ... since its process started; 0: none yet
  MonoTime sensed_at;                // its process's word
  float rotation[4] = {1, 0, 0, 0};  // base in world: unit quaternion w x y z
  float angular_velocity[3] = {};    // rad/s, base frame
  float acceleration[3] = {};        // m/s^2, base frame; specific force: +g upwards at rest
};
template <std::same_as<ImuSample> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(sequence),         TAKT_FIELD(sensed_at),    TAKT_FIELD(rotation),
      TAKT_FIELD(angular_velocity), TAKT_FIELD(acceleration),
  };
}
static_assert(std::is_standard_layout_v<ImuSample> && std::is_trivially_copyable_v<ImuSample>);
static_assert(sizeof(ImuSample) == 16 + 4 * kImuValues);

// Of the newest sample, every tick. Only `usable` ones reach the estimate; the others leave the one before in force.
enum class ImuVerdict : std::uint8_t {
  absent,       // the robot has no IMU, or nothing was read yet
  usable,       // also: the same one as in the tick before
  from_future,  // sensed more than a control period ahead of this tick
  backwards,    // sensed before the sample that is in force
  not_finite,   // NaN or infinity inside
  not_unit,     // the quaternion's norm is off by more than 1 %
  contradicts,  // its rotation turns otherwise than its angular velocity says
};
inline constexpr std::size_t kImuVerdictCount = 7;

constexpr std::string_view name(ImuVerdict verdict) {
  constexpr std::array<std::string_view, kImuVerdictCount> names{"absent",     "usable",   "from_future", "backwards",
                                                                 "not_finite", "not_unit", "contradicts"};
  const auto index = static_cast<std::size_t>(verdict);
  return index < names.size() ? names[index] : "invalid";
}

// Which way down is, in the base frame: (0, 0, -1) upright. Unit vector for a unit quaternion.
constexpr std::array<float, 3> projected_gravity(const ImuSample& imu) {
  const auto [w, x, y, z] = imu.rotation;
  return {2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1};
}

// Angle between the base's z axis and the world's, 0..pi rad.
inline float tilt_of(const ImuSample& imu) {
  const float up = -projected_gravity(imu)[2];
  return std::acos(up < -1 ? -1.0F : up > 1 ? 1.0F : up);
}

}  // namespace takt
