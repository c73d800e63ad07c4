// SPDX-License-Identifier: Apache-2.0
// ROS 2's standard messages in a recorded run, for the usual viewers: their ros2msg text, their CDR form. The layouts
// are those of common_interfaces and rcl_interfaces; comments are ours.
#pragma once

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

}  // namespace takt::monitor
