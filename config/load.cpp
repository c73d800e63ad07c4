#include "config/load.hpp"

#include <filesystem>

#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/hash.hpp"
#include "config/reader.hpp"
#include "config/schema.hpp"
#include "config/writer.hpp"

namespace takt::config {
namespace {

// Every process must agree on the robot, wherever its file lies: paths enter the hash as written.
void seal(RobotConfig& robot) {
  Writer writer;
  describe(writer, robot);
  robot.resolved = writer.result();
  robot.sha256 = sha256_hex(robot.resolved);
  robot.hash = leading_64_bits(robot.sha256);
}

std::string absolute_path(const std::string& written, const std::string& robot_file) {
  const auto folder = std::filesystem::absolute(robot_file).parent_path();
  return (folder / written).lexically_normal().string();
}

}  // namespace

std::expected<RobotConfig, std::string> parse(std::string_view text, const std::string& name_for_messages) {
  Problems problems(name_for_messages);
  const Node root = read_document(text, Tags::refuse, problems);
  if (problems.empty() && root.kind != Node::Kind::map)
    problems.add(root.place, "holds no robot; begin with `schema: takt.robot/1`");
  if (!problems.empty()) return std::unexpected(problems.text());

  RobotConfig robot;
  robot.file = name_for_messages;
  Places places;
  Reader reader(root, "", problems, places);
  describe(reader, robot);
  reader.finish();
  if (!problems.empty()) return std::unexpected(problems.text());
  if (robot.policy && robot.policy->action.joint_of_output.empty())
    robot.policy->action.joint_of_output = robot.policy->joint_order;
  check(robot, places, problems);
  if (!problems.empty()) return std::unexpected(problems.text());

  seal(robot);
  if (robot.policy) robot.policy->file = absolute_path(robot.policy->file, robot.file);
  robot.record.directory = absolute_path(robot.record.directory, robot.file);
  return robot;
}

std::expected<RobotConfig, std::string> load(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return std::unexpected(text.error());
  return parse(*text, path);
}

}  // namespace takt::config
