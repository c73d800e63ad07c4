// SPDX-License-Identifier: Apache-2.0
// ROS 2's standard messages in a recorded run, for the usual viewers: their ros2msg text, their CDR form. The layouts
// are those of common_interfaces and rcl_interfaces; comments are ours.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/tick_record.hpp"
#include "monitor/record/cdr.hpp"
#include "monitor/record/diagnostics.hpp"

namespace takt::monitor {

std::string joint_state_schema();  // sensor_msgs/msg/JointState
void encode_joint_state(const TickRecord& record, std::int64_t unix_ns, std::span<const std::string> names,
                        CdrWriter& out);

std::string diagnostic_array_schema();  // diagnostic_msgs/msg/DiagnosticArray
void encode_diagnostic_array(std::span<const Diagnostic> parts, std::int64_t unix_ns, std::string_view hardware_id,
                             CdrWriter& out);

std::string log_schema();  // rcl_interfaces/msg/Log
// `name`: who says it.
void encode_log(Level level, std::string_view name, std::string_view text, std::int64_t unix_ns, CdrWriter& out);

std::string string_schema();  // std_msgs/msg/String
void encode_string(std::string_view text, CdrWriter& out);

struct FrameTransform {
  std::string parent, child;            // frames
  std::array<double, 3> translation{};  // of the child's origin in the parent's frame, m
  std::array<double, 4> rotation{};     // of the child in the parent's frame: unit quaternion x y z w
};
std::string tf_message_schema();  // tf2_msgs/msg/TFMessage
void encode_tf_message(std::span<const FrameTransform> transforms, std::int64_t unix_ns, CdrWriter& out);

std::string compressed_image_schema();  // sensor_msgs/msg/CompressedImage
// `frame`: the camera; `format`: "png", of which `file` is a whole one.
void encode_compressed_image(std::string_view frame, std::string_view format, std::string_view file,
                             std::int64_t unix_ns, CdrWriter& out);

}  // namespace takt::monitor
