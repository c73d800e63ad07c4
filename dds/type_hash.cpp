// SPDX-License-Identifier: Apache-2.0
#include "dds/type_hash.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include "config/load.hpp"

namespace takt::dds {
namespace {

using enum RosType;

constexpr std::string_view kTimeName = "builtin_interfaces/msg/Time";
constexpr std::string_view kHeaderName = "std_msgs/msg/Header";

constexpr RosField kTime[] = {{"sec", int32}, {"nanosec", uint32}};
constexpr RosField kHeader[] = {{"stamp", nested, false, kTimeName}, {"frame_id", string}};
constexpr RosField kJointState[] = {{"header", nested, false, kHeaderName},
                                    {"name", string, true},
                                    {"position", float64, true},
                                    {"velocity", float64, true},
                                    {"effort", float64, true}};
constexpr std::string_view kQuaternionName = "geometry_msgs/msg/Quaternion";
constexpr std::string_view kVector3Name = "geometry_msgs/msg/Vector3";
constexpr RosField kImage[] = {{"header", nested, false, kHeaderName},
                               {"height", uint32},
                               {"width", uint32},
                               {"encoding", string},
                               {"is_bigendian", uint8},
                               {"step", uint32},
                               {"data", uint8, true}};
constexpr RosField kQuaternion[] = {{"x", float64}, {"y", float64}, {"z", float64}, {"w", float64}};
constexpr RosField kVector3[] = {{"x", float64}, {"y", float64}, {"z", float64}};
constexpr RosField kTwist[] = {{"linear", nested, false, kVector3Name}, {"angular", nested, false, kVector3Name}};
constexpr RosField kImu[] = {{"header", nested, false, kHeaderName},
                             {"orientation", nested, false, kQuaternionName},
                             {"orientation_covariance", float64, false, {}, 9},
                             {"angular_velocity", nested, false, kVector3Name},
                             {"angular_velocity_covariance", float64, false, {}, 9},
                             {"linear_acceleration", nested, false, kVector3Name},
                             {"linear_acceleration_covariance", float64, false, {}, 9}};
constexpr RosField kKeyValue[] = {{"key", string}, {"value", string}};
constexpr RosField kDiagnosticStatus[] = {{"level", octet},
                                          {"name", string},
                                          {"message", string},
                                          {"hardware_id", string},
                                          {"values", nested, true, "diagnostic_msgs/msg/KeyValue"}};
constexpr RosField kDiagnosticArray[] = {{"header", nested, false, kHeaderName},
                                         {"status", nested, true, "diagnostic_msgs/msg/DiagnosticStatus"}};
constexpr RosField kStatus[] = {{"stamp", nested, false, kTimeName},
                                {"robot", string},
                                {"machine", string},
                                {"running", boolean},
                                {"tick", uint64},
                                {"mode", string},
                                {"cause", string},
                                {"detail", string},
                                {"freshness", string},
                                {"age_ns", int64},
                                {"window_misses", uint32},
                                {"window_ticks", uint32},
                                {"skipped_periods", uint64},
                                {"overruns", uint64},
                                {"refused_commands", uint32},
                                {"integration_errors", uint32},
                                {"command_sequence", uint64},
                                {"observation_answered", uint64},
                                {"drives_enabled", boolean},
                                {"causes_active", string, true},
                                {"lost_joint_states", uint64},
                                {"lost_diagnostics", uint64},
                                {"lost_status", uint64},
                                {"lost_command_ages", uint64},
                                {"request_id", uint64},
                                {"request_verb", string},
                                {"request_done", boolean},
                                {"request_answer", string}};
constexpr RosField kCommandAge[] = {{"stamp", nested, false, kTimeName},
                                    {"robot", string},
                                    {"tick", uint64},
                                    {"command_sequence", uint64},
                                    {"observation_id", uint64},
                                    {"sense_ns", int64},
                                    {"queue_ns", int64},
                                    {"infer_ns", int64},
                                    {"publish_ns", int64},
                                    {"hold_ns", int64},
                                    {"total_ns", int64}};
constexpr RosField kRequest[] = {{"robot", string}, {"machine", string}, {"id", uint64}, {"verb", string}};

constexpr RosMessage kMessages[] = {{kTimeName, kTime},
                                    {kHeaderName, kHeader},
                                    {kQuaternionName, kQuaternion},
                                    {kVector3Name, kVector3},
                                    {"geometry_msgs/msg/Twist", kTwist},
                                    {"sensor_msgs/msg/JointState", kJointState},
                                    {"sensor_msgs/msg/Image", kImage},
                                    {"sensor_msgs/msg/Imu", kImu},
                                    {"diagnostic_msgs/msg/KeyValue", kKeyValue},
                                    {"diagnostic_msgs/msg/DiagnosticStatus", kDiagnosticStatus},
                                    {"diagnostic_msgs/msg/DiagnosticArray", kDiagnosticArray},
                                    {"takt_msgs/msg/Status", kStatus},
                                    {"takt_msgs/msg/CommandAge", kCommandAge},
                                    {"takt_msgs/msg/Request", kRequest}};

const RosMessage& find(std::string_view name) {
  const auto* const found = std::ranges::find(kMessages, name, &RosMessage::name);
  if (found == std::end(kMessages)) throw std::invalid_argument(fmt::format("no message {}", name));
  return *found;
}

void collect_references(const RosMessage& message, std::set<std::string_view>& names) {
  for (const RosField& field : message.fields) {
    if (!field.nested.empty() && names.insert(field.nested).second) collect_references(find(field.nested), names);
  }
}

// The hash is over these very characters: order of members and blanks included.
std::string description(const RosMessage& message) {
  constexpr int kArray = 48, kUnboundedSequence = 144;
  std::string fields;
  for (const RosField& field : message.fields) {
    fields += fmt::format(
        R"({}{{"name": "{}", "type": {{"type_id": {}, "capacity": {}, "string_capacity": 0, "nested_type_name": "{}"}}}})",
        fields.empty() ? "" : ", ", field.name,
        static_cast<int>(field.type) + (field.is_sequence ? kUnboundedSequence : 0) + (field.array != 0 ? kArray : 0),
        field.array, field.nested);
  }
  return fmt::format(R"({{"type_name": "{}", "fields": [{}]}})", message.name, fields);
}

}  // namespace

std::span<const RosMessage> ros_messages() {
  return kMessages;
}

std::string type_hash(std::string_view message) {
  const RosMessage& root = find(message);
  std::set<std::string_view> names;
  collect_references(root, names);
  std::string references;
  for (const std::string_view name : names) references += (references.empty() ? "" : ", ") + description(find(name));
  return "RIHS01_" +
         config::sha256_hex(fmt::format(R"({{"type_description": {}, "referenced_type_descriptions": [{}]}})",
                                        description(root), references));
}

std::string user_data(std::string_view message) {
  return fmt::format("typehash={};", type_hash(message));
}

}  // namespace takt::dds
