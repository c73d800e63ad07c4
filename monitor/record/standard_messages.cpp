// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/standard_messages.hpp"

namespace takt::monitor {
namespace {

constexpr std::string_view kTime =
    "MSG: builtin_interfaces/Time\n"
    "int32 sec\n"
    "uint32 nanosec\n";
constexpr std::string_view kHeader =
    "MSG: std_msgs/Header\n"
    "builtin_interfaces/Time stamp\n"
    "string frame_id\n";
constexpr std::string_view kJointState =
    "std_msgs/Header header\n"
    "string[] name\n"
    "float64[] position  # rad or m, measured\n"
    "float64[] velocity  # rad/s or m/s, estimated\n"
    "float64[] effort    # Nm or N, measured\n";
constexpr std::string_view kDiagnosticArray =
    "std_msgs/Header header\n"
    "diagnostic_msgs/DiagnosticStatus[] status\n";
constexpr std::string_view kDiagnosticStatus =
    "MSG: diagnostic_msgs/DiagnosticStatus\n"
    "byte OK=0\n"
    "byte WARN=1\n"
    "byte ERROR=2\n"
    "byte STALE=3\n"
    "byte level\n"
    "string name         # robot and part\n"
    "string message\n"
    "string hardware_id  # the robot\n"
    "diagnostic_msgs/KeyValue[] values\n";
constexpr std::string_view kKeyValue =
    "MSG: diagnostic_msgs/KeyValue\n"
    "string key\n"
    "string value\n";
constexpr std::string_view kLog =
    "byte DEBUG=10\n"
    "byte INFO=20\n"
    "byte WARN=30\n"
    "byte ERROR=40\n"
    "byte FATAL=50\n"
    "builtin_interfaces/Time stamp\n"
    "uint8 level\n"
    "string name      # the robot\n"
    "string msg\n"
    "string file      # empty\n"
    "string function  # empty\n"
    "uint32 line      # 0\n";

constexpr std::string_view kString = "string data\n";
constexpr std::string_view kCompressedImage =
    "std_msgs/Header header  # when it was taken; frame_id: the camera\n"
    "string format           # png\n"
    "uint8[] data\n";
constexpr std::string_view kTfMessage = "geometry_msgs/TransformStamped[] transforms\n";
constexpr std::string_view kTransformStamped =
    "MSG: geometry_msgs/TransformStamped\n"
    "std_msgs/Header header  # frame_id: the parent\n"
    "string child_frame_id\n"
    "geometry_msgs/Transform transform\n";
constexpr std::string_view kTransform =
    "MSG: geometry_msgs/Transform\n"
    "geometry_msgs/Vector3 translation  # m\n"
    "geometry_msgs/Quaternion rotation\n";
constexpr std::string_view kVector3 =
    "MSG: geometry_msgs/Vector3\n"
    "float64 x\n"
    "float64 y\n"
    "float64 z\n";
constexpr std::string_view kQuaternion =
    "MSG: geometry_msgs/Quaternion\n"
    "float64 x 0\n"
    "float64 y 0\n"
    "float64 z 0\n"
    "float64 w 1\n";

// A definition and those it names, as MCAP wants them.
std::string schema_of(std::string_view message, std::initializer_list<std::string_view> parts) {
  std::string text(message);
  for (const std::string_view part : parts) text.append(80, '=').append("\n").append(part);
  return text;
}

void put_time(CdrWriter& out, std::int64_t unix_ns) {
  out.put(static_cast<std::int32_t>(unix_ns / 1'000'000'000));
  out.put(static_cast<std::uint32_t>(unix_ns % 1'000'000'000));
}

void put_header(CdrWriter& out, std::int64_t unix_ns, std::string_view frame = "") {
  put_time(out, unix_ns);
  out.put_string(frame);
}

void put_doubles(CdrWriter& out, const TickRecord& record, float (*value)(const JointRecord&)) {
  out.put_count(record.header.joint_count);
  for (std::size_t joint = 0; joint < record.header.joint_count; ++joint) {
    out.put(static_cast<double>(value(record.joints[joint])));
  }
}

std::uint8_t log_level(Level level) {
  constexpr std::uint8_t kInfo = 20, kWarn = 30, kError = 40;
  switch (level) {
    case Level::ok:
      return kInfo;
    case Level::warn:
      return kWarn;
    case Level::error:
    case Level::stale:
      return kError;
  }
  return kError;
}

}  // namespace

std::string joint_state_schema() {
  return schema_of(kJointState, {kHeader, kTime});
}

void encode_joint_state(const TickRecord& record, std::int64_t unix_ns, std::span<const std::string> names,
                        CdrWriter& out) {
  out.clear();
  put_header(out, unix_ns);
  out.put_count(names.size());
  for (const std::string& each : names) out.put_string(each);
  put_doubles(out, record, [](const JointRecord& joint) { return joint.feedback.q; });
  put_doubles(out, record, [](const JointRecord& joint) { return joint.dq_estimate; });
  put_doubles(out, record, [](const JointRecord& joint) { return joint.feedback.tau; });
}

std::string diagnostic_array_schema() {
  return schema_of(kDiagnosticArray, {kHeader, kTime, kDiagnosticStatus, kKeyValue});
}

void encode_diagnostic_array(std::span<const Diagnostic> parts, std::int64_t unix_ns, std::string_view hardware_id,
                             CdrWriter& out) {
  out.clear();
  put_header(out, unix_ns);
  out.put_count(parts.size());
  for (const Diagnostic& part : parts) {
    out.put(static_cast<std::uint8_t>(part.level));
    out.put_string(part.name);
    out.put_string(part.message);
    out.put_string(hardware_id);
    out.put_count(part.values.size());
    for (const auto& [key, value] : part.values) {
      out.put_string(key);
      out.put_string(value);
    }
  }
}

std::string log_schema() {
  return schema_of(kLog, {kTime});
}

void encode_log(Level level, std::string_view name, std::string_view text, std::int64_t unix_ns, CdrWriter& out) {
  out.clear();
  put_time(out, unix_ns);
  out.put(log_level(level));
  out.put_string(name);
  out.put_string(text);
  out.put_string("");
  out.put_string("");
  out.put(std::uint32_t{0});
}

std::string string_schema() {
  return std::string(kString);
}

void encode_string(std::string_view text, CdrWriter& out) {
  out.clear();
  out.put_string(text);
}

std::string tf_message_schema() {
  return schema_of(kTfMessage, {kTransformStamped, kHeader, kTime, kTransform, kVector3, kQuaternion});
}

void encode_tf_message(std::span<const FrameTransform> transforms, std::int64_t unix_ns, CdrWriter& out) {
  out.clear();
  out.put_count(transforms.size());
  for (const FrameTransform& each : transforms) {
    put_header(out, unix_ns, each.parent);
    out.put_string(each.child);
    for (const double value : each.translation) out.put(value);
    for (const double value : each.rotation) out.put(value);
  }
}

std::string compressed_image_schema() {
  return schema_of(kCompressedImage, {kHeader, kTime});
}

void encode_compressed_image(std::string_view frame, std::string_view format, std::string_view file,
                             std::int64_t unix_ns, CdrWriter& out) {
  out.clear();
  put_header(out, unix_ns, frame);
  out.put_string(format);
  out.put_octets(std::as_bytes(std::span(file)));
}

}  // namespace takt::monitor
