// SPDX-License-Identifier: Apache-2.0
// Goal: the type hashes are those ROS 2 computes. Method: hashes that ROS 2's own tools print for its standard
// messages; and the fields that enter the hashes compared with the IDL that defines the wire and with the .msg files
// that ROS 2 would compute its hash from.
#include "dds/type_hash.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace takt::dds {
namespace {

struct Field {
  std::string name;
  RosType type = RosType::string;
  bool is_sequence = false;
  std::string nested;
  std::uint32_t array = 0;
  bool operator==(const Field&) const = default;
  friend void PrintTo(const Field& field, std::ostream* out) {
    *out << field.name << " type " << static_cast<int>(field.type) << (field.is_sequence ? "[] " : " ") << field.nested;
  }
};

std::vector<Field> hashed_fields(std::string_view message) {
  std::vector<Field> fields;
  for (const RosMessage& one : ros_messages()) {
    if (one.name != message) continue;
    for (const RosField& field : one.fields)
      fields.push_back(
          {std::string(field.name), field.type, field.is_sequence, std::string(field.nested), field.array});
  }
  return fields;
}

// "a::msg::dds_::B_" -> "a/msg/B"
std::string ros_name(std::string idl) {
  for (std::size_t at = 0; (at = idl.find("::")) != std::string::npos;) idl.replace(at, 2, "/");
  if (const std::size_t at = idl.find("dds_/"); at != std::string::npos) idl.erase(at, 5);
  if (idl.ends_with('_')) idl.pop_back();
  return idl;
}

Field idl_field(std::string line, const std::string& package) {
  static const std::map<std::string, RosType> kTypes{
      {"long", RosType::int32},      {"unsigned long", RosType::uint32},
      {"long long", RosType::int64}, {"unsigned long long", RosType::uint64},
      {"double", RosType::float64},  {"boolean", RosType::boolean},
      {"octet", RosType::octet},     {"string", RosType::string},
      {"uint8", RosType::uint8}};
  line.erase(line.find(';'));
  Field field;
  field.name = line.substr(line.rfind(' ') + 1);
  if (const std::size_t bracket = field.name.find('['); bracket != std::string::npos) {
    field.array = static_cast<std::uint32_t>(std::stoul(field.name.substr(bracket + 1)));
    field.name.resize(bracket);
  }
  std::string type = line.substr(0, line.rfind(' '));
  if (type.starts_with("sequence<")) {
    field.is_sequence = true;
    type = type.substr(9, type.size() - 10);
  }
  const auto known = kTypes.find(type);
  field.type = known == kTypes.end() ? RosType::nested : known->second;
  if (known == kTypes.end()) {
    const std::string name = ros_name(type);
    field.nested = name.find('/') == std::string::npos ? package + "/msg/" + name : name;
  }
  return field;
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(' ');
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

// The project's own IDL, one declaration per line.
std::map<std::string, std::vector<Field>> idl_messages() {
  std::map<std::string, std::vector<Field>> messages;
  std::ifstream file("dds/ros_types.idl");
  std::string package, message;
  for (std::string line; std::getline(file, line);) {
    line = trimmed(line);
    if (line.starts_with("//")) continue;
    if (line.starts_with("module ")) package = line.substr(7, line.find(' ', 7) - 7);
    if (line.starts_with("@final struct ")) {
      message = package + "/msg/" + ros_name(line.substr(14, line.find(' ', 14) - 14));
    } else if (line.starts_with("}")) {
      message.clear();
    } else if (!message.empty()) {
      messages[message].push_back(idl_field(line, package));
    }
  }
  return messages;
}

std::vector<Field> msg_file_fields(const std::filesystem::path& path) {
  static const std::map<std::string, RosType> kTypes{
      {"uint32", RosType::uint32}, {"int64", RosType::int64},   {"uint64", RosType::uint64},
      {"bool", RosType::boolean},  {"string", RosType::string}, {"builtin_interfaces/Time", RosType::nested}};
  std::vector<Field> fields;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string type;
    Field field;
    if (!(words >> type >> field.name)) continue;
    field.is_sequence = type.ends_with("[]");
    if (field.is_sequence) type.resize(type.size() - 2);
    field.type = kTypes.at(type);
    if (field.type == RosType::nested) field.nested = "builtin_interfaces/msg/Time";
    fields.push_back(field);
  }
  return fields;
}

TEST(TypeHash, StandardMessagesHaveTheHashesThatRos2Prints) {
  EXPECT_EQ(type_hash("sensor_msgs/msg/JointState"),
            "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e");
  EXPECT_EQ(type_hash("diagnostic_msgs/msg/DiagnosticArray"),
            "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e");
  EXPECT_EQ(type_hash("diagnostic_msgs/msg/KeyValue"),
            "RIHS01_d68081eaa540288c5440753baecef0c4e16e81a5f78ad68902ded5100413bb42");
  EXPECT_EQ(user_data("sensor_msgs/msg/JointState"),
            "typehash=RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e;");
  EXPECT_EQ(type_hash("sensor_msgs/msg/Imu"),
            "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b");
  EXPECT_EQ(type_hash("sensor_msgs/msg/Image"),
            "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47");
  EXPECT_EQ(type_hash("geometry_msgs/msg/Twist"),
            "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a");
  EXPECT_THROW((void)type_hash("sensor_msgs/msg/LaserScan"), std::invalid_argument);
}

TEST(TypeHash, HashesAreOfTheFieldsOnTheWire) {
  const auto idl = idl_messages();
  ASSERT_EQ(idl.size(), ros_messages().size());
  for (const auto& [message, fields] : idl) EXPECT_EQ(hashed_fields(message), fields) << message;
}

TEST(TypeHash, HashesAreOfTheMsgFilesThatRos2WouldBuild) {
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator("dds/takt_msgs/msg")) {
    const std::string message = "takt_msgs/msg/" + entry.path().stem().string();
    EXPECT_EQ(hashed_fields(message), msg_file_fields(entry.path())) << message;
    ++files;
  }
  EXPECT_EQ(files, 3U);
}

}  // namespace
}  // namespace takt::dds
