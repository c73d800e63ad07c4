// One sample of an outside sensor (a camera's target estimate, an IMU), published by its own process into a mailbox
// that policy hosts read. The executive never reads it; its age reaches the executive as
// CommandHeader::outside_sensed_at, which can only make a command older.
#pragma once

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

#define TAKT_SENSOR_FIELDS                                                                                           \
  {                                                                                                                  \
    TAKT_FIELD(SensorSample, sequence), TAKT_FIELD(SensorSample, sensed_at), TAKT_FIELD(SensorSample, published_at), \
        TAKT_FIELD(SensorSample, value_count), TAKT_FIELD(SensorSample, reserved), TAKT_FIELD(SensorSample, values)  \
  }

static_assert(std::is_standard_layout_v<SensorSample> && std::is_trivially_copyable_v<SensorSample>);
static_assert(sizeof(SensorSample) == 32 + 4 * kMaxSensorValues);
static_assert(is_gapless(TAKT_SENSOR_FIELDS, sizeof(SensorSample)));
inline constexpr std::uint64_t kSensorSampleLayout = layout_hash(TAKT_SENSOR_FIELDS);
#undef TAKT_SENSOR_FIELDS

}  // namespace takt
