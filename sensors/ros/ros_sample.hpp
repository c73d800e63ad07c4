// SPDX-License-Identifier: Apache-2.0
// Messages of ROS 2 as a sensor's samples. Pure: idlc's structures in, values out.
//
//   Image       rows without their padding; the encoding and size of the robot file, or refused
//   Imu         rotation w x y z, angular velocity x y z rad/s, linear acceleration x y z m/s^2: as REP 145 has them,
//   in the
//               message's own frame, which has to be the base
//   JointState  one quantity of the joints that the robot file names, in its order
//   Twist       linear x y z, angular x y z; of a sensor with 3 values linear x, linear y, angular z
//
// Errors: one sentence, and nothing of the sample counts. Numbers that are none pass: readers judge them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/joints.hpp"
#include "ros_types.h"

namespace takt::sensors {

struct RosValues {
  std::array<float, kMaxSensorValues> at{};
  std::size_t count = 0;
};

using RosResult = std::expected<void, std::string>;

// Preconditions: sensor.ros, of that type, checked at load; `pixels`: sensor.image->bytes().
RosResult take_image(const sensor_msgs_msg_dds__Image_& message, const config::Sensor& sensor,
                     std::span<std::byte> pixels);
RosResult take(const sensor_msgs_msg_dds__Imu_& message, const config::Sensor& sensor, RosValues& values);
RosResult take(const sensor_msgs_msg_dds__JointState_& message, const config::Sensor& sensor, RosValues& values);
RosResult take(const geometry_msgs_msg_dds__Twist_& message, const config::Sensor& sensor, RosValues& values);

// Unix ns; 0: no stamp.
std::int64_t stamp_of(const std_msgs_msg_dds__Header_& header);

}  // namespace takt::sensors
