// SPDX-License-Identifier: Apache-2.0
// One sample of an outside sensor (a camera's target estimate, an IMU), published by its own process into a mailbox
// that policy hosts read. The executive never reads it; its age reaches the executive as
// CommandHeader::outside_sensed_at, which can only make a command older.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "executive/contract/joints.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

struct SensorSample {
  std::uint64_t sequence = 0;  // 1, 2, 3, ...
  MonoTime sensed_at;          // shutter / sampling instant
  MonoTime published_at;
  std::uint32_t value_count = 0;  // 1..kMaxSensorValues
  std::uint32_t reserved = 0;
  float values[kMaxSensorValues] = {};  // SI units, meaning fixed by the robot's configuration
};
template <std::same_as<SensorSample> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(sequence),    TAKT_FIELD(sensed_at), TAKT_FIELD(published_at),
      TAKT_FIELD(value_count), TAKT_FIELD(reserved),  TAKT_FIELD(values),
  };
}

static_assert(std::is_standard_layout_v<SensorSample> && std::is_trivially_copyable_v<SensorSample>);
static_assert(sizeof(SensorSample) == 32 + 4 * kMaxSensorValues);

}  // namespace takt
