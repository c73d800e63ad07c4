// SPDX-License-Identifier: Apache-2.0
// A sensor's sample as an IMU's, value by value (imu.hpp); nothing is judged. Precondition: value_count is kImuValues.
#pragma once

#include <algorithm>

#include "executive/contract/imu.hpp"
#include "executive/contract/sensor_sample.hpp"

namespace takt {

inline ImuSample imu_of(const SensorSample& sample) {
  ImuSample imu;
  imu.sequence = sample.sequence;
  imu.sensed_at = sample.sensed_at;
  std::copy_n(sample.values, 4, imu.rotation);
  std::copy_n(sample.values + 4, 3, imu.angular_velocity);
  std::copy_n(sample.values + 7, 3, imu.acceleration);
  return imu;
}

}  // namespace takt
