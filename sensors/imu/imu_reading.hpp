// SPDX-License-Identifier: Apache-2.0
// From the part's samples to the executive's: in the base frame, each once, stamped.
//
// Stamp: when the first byte or frame of the sample was received, or earlier: one that waited in a buffer is as old as
// the part's own clock, where it tells that, says since the one before (0.2 per mille are granted to its crystal).
// Where that says nothing (the first sample, a part that booted anew) it is as old as the wait in which it was read:
// how long it lay there is not known. So a stamp is never after the arrival. What the part itself needs from sensing to
// sending is not in it. A packet counter that stands still is a repeat, which is dropped; one that jumped tells how
// many were lost. After the part restarted or the port was opened anew, begin with a new one. Pure. Thread rule: one
// thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "sensors/imu/mt_sample.hpp"
#include "sensors/wait_start.hpp"

namespace takt::sensors {

using Quaternion = std::array<double, 4>;  // w x y z

// Fixed-axis roll, pitch, yaw, rad.
Quaternion rotation_of(const config::Vector3& rpy);

struct ImuCounts {
  std::uint64_t samples = 0, lost = 0, repeated = 0;
};

class ImuReading {
 public:
  // `mounting`: the sensor's frame in the base frame.
  explicit ImuReading(const Quaternion& mounting) : mounting_(mounting) {}

  // Nothing: a repeat. Sequence and publication are the caller's to fill in.
  std::optional<SensorSample> take(const MtSample& sample, Heard heard);
  [[nodiscard]] const ImuCounts& counts() const { return counts_; }

 private:
  struct Before {
    std::uint16_t counter;
    std::optional<std::uint32_t> ticks;
    MonoTime sensed_at;
  };
  [[nodiscard]] MonoTime stamp(const MtSample& sample, Heard heard) const;

  Quaternion mounting_;
  std::optional<Before> before_;
  ImuCounts counts_;
};

}  // namespace takt::sensors
