// SPDX-License-Identifier: Apache-2.0
#include "sensors/ros/ros_sample.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

namespace takt::sensors {
namespace {

constexpr std::string_view name(config::RosEncoding encoding) {
  constexpr std::array<std::string_view, 5> names{"mono8", "rgb8", "bgr8", "rgba8", "bgra8"};
  return names[static_cast<std::size_t>(encoding)];
}

// What a stranger sent, for one line of a log.
std::string shown(const char* text) {
  constexpr std::size_t kMost = 40;
  std::string out(text == nullptr ? "" : text);
  out.resize(std::min(out.size(), kMost));
  for (char& c : out)
    if (c < ' ' || c > '~') c = '?';
  return out;
}

void put(RosValues& values, double value) {
  values.at[values.count++] = static_cast<float>(value);
}

void put(RosValues& values, const geometry_msgs_msg_dds__Vector3_& vector) {
  for (const double value : {vector.x, vector.y, vector.z}) put(values, value);
}

}  // namespace

std::int64_t stamp_of(const std_msgs_msg_dds__Header_& header) {
  return std::int64_t{header.stamp.sec} * 1'000'000'000 + header.stamp.nanosec;
}

RosResult take_image(const sensor_msgs_msg_dds__Image_& message, const config::Sensor& sensor,
                     std::span<std::byte> pixels) {
  const config::ImageShape& shape = *sensor.image;
  const std::string_view wanted = name(sensor.ros->encoding);
  if (message.encoding == nullptr || message.encoding != wanted)
    return std::unexpected(fmt::format("images are {}, the robot file says {}", shown(message.encoding), wanted));
  if (message.height != shape.height || message.width != shape.width)
    return std::unexpected(fmt::format("images are {} x {}, the robot file says {} x {}", message.height, message.width,
                                       shape.height, shape.width));
  const std::size_t row = std::size_t{shape.width} * shape.channels;
  if (message.step < row || message.data._length < std::size_t{message.step} * (shape.height - 1) + row)
    return std::unexpected(fmt::format("an image of {} bytes in rows of {}, for {} x {} x {}", message.data._length,
                                       message.step, shape.height, shape.width, shape.channels));
  for (std::size_t y = 0; y < shape.height; ++y)
    std::memcpy(&pixels[y * row], message.data._buffer + y * message.step, row);
  return {};
}

RosResult take(const sensor_msgs_msg_dds__Imu_& message, const config::Sensor&, RosValues& values) {
  // How a message says that it has none: sensor_msgs/msg/Imu.
  if (message.orientation_covariance[0] == -1)
    return std::unexpected("the Imu gives no orientation: use one that does, or fuse it first (imu_filter_madgwick)");
  if (message.angular_velocity_covariance[0] == -1 || message.linear_acceleration_covariance[0] == -1)
    return std::unexpected("the Imu gives no angular velocity, or no acceleration: use one that does");
  const geometry_msgs_msg_dds__Quaternion_& turn = message.orientation;
  for (const double value : {turn.w, turn.x, turn.y, turn.z}) put(values, value);
  put(values, message.angular_velocity);
  put(values, message.linear_acceleration);
  return {};
}

RosResult take(const sensor_msgs_msg_dds__JointState_& message, const config::Sensor& sensor, RosValues& values) {
  const config::RosTopic& ros = *sensor.ros;
  const std::array quantities{std::pair(&message.position, "position"), std::pair(&message.velocity, "velocity"),
                              std::pair(&message.effort, "effort")};
  const auto& [given, quantity] = quantities[static_cast<std::size_t>(ros.quantity)];
  const std::span names(message.name._buffer, message.name._length);
  if (given->_length != names.size())
    return std::unexpected(
        fmt::format("a JointState of {} joints has {} values of {}", names.size(), given->_length, quantity));
  for (const config::RosJoint& joint : ros.joints) {
    const auto found =
        std::ranges::find_if(names, [&](const char* one) { return one != nullptr && joint.name == one; });
    if (found == names.end()) return std::unexpected(fmt::format("a JointState without joint {}", joint.name));
    put(values, given->_buffer[found - names.begin()]);
  }
  return {};
}

RosResult take(const geometry_msgs_msg_dds__Twist_& message, const config::Sensor& sensor, RosValues& values) {
  constexpr std::uint32_t kPlanar = 3;
  if (sensor.values == kPlanar) {
    for (const double value : {message.linear.x, message.linear.y, message.angular.z}) put(values, value);
  } else {
    put(values, message.linear);
    put(values, message.angular);
  }
  return {};
}

}  // namespace takt::sensors
