// SPDX-License-Identifier: Apache-2.0
#include "config/load.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "config/based_on.hpp"
#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/hash.hpp"
#include "config/joint_defaults.hpp"
#include "config/migrations.hpp"
#include "config/reader.hpp"
#include "config/schema.hpp"
#include "config/writer.hpp"

namespace takt::config {
namespace {

// Every process must agree on the robot, wherever its file lies: paths enter the hash as written.
void seal(RobotConfig& robot) {
  Writer writer(Defaults::left_out);
  describe(writer, robot);
  robot.resolved = writer.result();
  robot.sha256 = sha256_hex(robot.resolved);
  robot.hash = leading_64_bits(robot.sha256);
}

std::string absolute_path(const std::string& written, const std::string& robot_file) {
  const auto folder = std::filesystem::absolute(robot_file).parent_path();
  return (folder / written).lexically_normal().string();
}

std::expected<RobotConfig, std::string> robot_of(Node root, const std::string& name_for_messages, Problems& problems) {
  RobotConfig robot;
  robot.file = name_for_messages;
  Places places;
  spread_joint_defaults(root, problems);
  Reader reader(root, "", problems, places);
  reader.knows(kJointDefaults);
  describe(reader, robot);
  reader.finish();
  if (!problems.empty()) return std::unexpected(problems.text());
  if (robot.policy && robot.policy->action.joint_of_output.empty())
    robot.policy->action.joint_of_output = robot.policy->joint_order;
  check(robot, places, problems);
  if (!problems.empty()) return std::unexpected(problems.text());

  seal(robot);
  if (robot.policy) robot.policy->file = absolute_path(robot.policy->file, robot.file);
  if (robot.policy && robot.policy->names_key())
    robot.policy->signed_by = absolute_path(robot.policy->signed_by, robot.file);
  if (robot.policy && robot.policy->engine)
    for (std::string* const path : {&robot.policy->engine->name, &robot.policy->engine->library})
      if (path->contains('/')) *path = absolute_path(*path, robot.file);
  for (Fallback& fallback : robot.fallbacks)
    if (fallback.has_own_file()) fallback.file = absolute_path(fallback.file, robot.file);
  for (Fallback& fallback : robot.fallbacks)
    if (is_shown(fallback.shown_by)) fallback.shown_by = absolute_path(fallback.shown_by, robot.file);
  for (StopConfig& stop : robot.stops)
    if (is_shown(stop.shown_by)) stop.shown_by = absolute_path(stop.shown_by, robot.file);
  if (robot.simulation && robot.simulation->mujoco)
    robot.simulation->mujoco->model = absolute_path(robot.simulation->mujoco->model, robot.file);
  if (robot.safe_torque_off && !robot.safe_torque_off->file.empty())
    robot.safe_torque_off->file = absolute_path(robot.safe_torque_off->file, robot.file);
  robot.record.directory = std::filesystem::absolute(robot.record.directory).lexically_normal().string();
  return robot;
}

// Places in the canonical text help no reader: complaints name the key instead.
void forget_places(Node& node) {
  node.place = {};
  for (Node& item : node.items) forget_places(item);
  for (Entry& entry : node.entries) {
    entry.key.place = {};
    forget_places(entry.value);
  }
}

constexpr std::string_view kNothing = "{}";  // of a map: nothing in it

Node* find_by_path(Node& root, std::string_view path) {
  Node* at = &root;
  while (!path.empty()) {
    const std::string_view key = path.substr(0, path.find('.'));
    path.remove_prefix(std::min(key.size() + 1, path.size()));
    Entry* const entry = at->entry_of(key);
    if (entry == nullptr) return nullptr;
    at = &entry->value;
  }
  return at;
}

std::expected<RobotConfig, std::string> parsed(std::string_view text, const std::string& name_for_messages,
                                               bool is_recorded) {
  Problems problems(name_for_messages);
  Node root = read_document(text, Tags::refuse, problems);
  if (is_recorded)
    migrate_recorded(root);
  else
    add_base(root, name_for_messages, problems);
  if (problems.empty() && root.kind != Node::Kind::map)
    problems.add(root.place, "holds no robot; begin with `schema: takt.robot/1`");
  if (!problems.empty()) return std::unexpected(problems.text());
  return robot_of(std::move(root), name_for_messages, problems);
}

}  // namespace

std::expected<RobotConfig, std::string> parse(std::string_view text, const std::string& name_for_messages) {
  return parsed(text, name_for_messages, false);
}

std::expected<RobotConfig, std::string> parse_recorded(std::string_view text, const std::string& name_for_messages) {
  return parsed(text, name_for_messages, true);
}

std::string with_every_default(const RobotConfig& robot) {
  Problems none(robot.file);
  Places places;
  const Node root = read_document(robot.resolved, Tags::refuse, none);
  RobotConfig as_written;  // paths too
  Reader reader(root, "", none, places);
  describe(reader, as_written);
  Writer writer(Defaults::written_out);
  describe(writer, as_written);
  return writer.result();
}

std::expected<RobotConfig, std::string> with_overrides(const RobotConfig& robot, std::span<const Override> overrides) {
  Problems problems(robot.file);
  Node root = read_document(with_every_default(robot), Tags::refuse, problems);
  forget_places(root);
  for (const Override& one : overrides) {
    Node* const node = find_by_path(root, one.key);
    if (node != nullptr && node->kind == Node::Kind::map && one.value == kNothing) {
      node->entries.clear();
      continue;
    }
    if (node == nullptr || (node->kind != Node::Kind::scalar && node->kind != Node::Kind::null)) {
      problems.add({}, "`" + one.key + "` is no key with a single value in a robot file; see `takt config keys`");
      continue;
    }
    node->kind = Node::Kind::scalar;
    node->text = one.value;
    node->quoted = false;
  }
  if (!problems.empty()) return std::unexpected(problems.text());
  return robot_of(std::move(root), robot.file, problems);
}

std::expected<RobotConfig, std::string> load(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return std::unexpected(text.error());
  return parse(*text, path);
}

}  // namespace takt::config
