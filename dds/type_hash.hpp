// SPDX-License-Identifier: Apache-2.0
// ROS 2's type hashes (REP 2016, "RIHS01"): SHA-256 over a JSON description of a message and of what it refers to. ROS
// 2 carries them in USER_DATA of writers and readers; from them its tools tell that both sides mean the same message.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace takt::dds {

// Numbers of type_description_interfaces/msg/FieldType.
enum class RosType : std::uint8_t {
  nested = 1,
  uint8 = 3,
  int32 = 6,
  uint32 = 7,
  int64 = 8,
  uint64 = 9,
  float64 = 11,
  boolean = 15,
  octet = 16,
  string = 17
};

struct RosField {
  std::string_view name;
  RosType type = RosType::string;
  bool is_sequence = false;      // unbounded
  std::string_view nested = {};  // RosType::nested: full name of the message
  std::uint32_t array = 0;       // fixed length; 0: none
};

struct RosMessage {
  std::string_view name;  // "sensor_msgs/msg/JointState"
  std::span<const RosField> fields;
};

// Every message of ros_types.idl, in its order.
std::span<const RosMessage> ros_messages();

// "RIHS01_<64 hex digits>". Precondition: the message is one of ros_messages().
std::string type_hash(std::string_view message);
// What a writer or reader of the message carries in USER_DATA.
std::string user_data(std::string_view message);

}  // namespace takt::dds
