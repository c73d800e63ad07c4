// SPDX-License-Identifier: Apache-2.0
#include "config/load.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "config/based_on.hpp"
#include "config/checks.hpp"
#include "config/document.hpp"
#include "config/file_kind.hpp"
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

struct WrittenPath {
  std::string key;  // as Places has it
  std::string* text;
};

// Those that begin in the robot file's folder.
std::vector<WrittenPath> paths_of(RobotConfig& robot) {
  std::vector<WrittenPath> paths;
  const auto add_if = [&paths](bool is_path, std::string key, std::string& text) {
    if (is_path) paths.push_back({std::move(key), &text});
  };
  if (robot.policy) {
    Policy& policy = *robot.policy;
    add_if(true, "policy.file", policy.file);
    add_if(policy.names_key(), "policy.signed_by", policy.signed_by);
    if (policy.engine) {
      add_if(policy.engine->name.contains('/'), "policy.engine.name", policy.engine->name);
      add_if(policy.engine->library.contains('/'), "policy.engine.library", policy.engine->library);
    }
  }
  for (Fallback& fallback : robot.fallbacks) {
    add_if(fallback.has_own_file(), "fallbacks." + fallback.name + ".file", fallback.file);
    add_if(is_shown(fallback.shown_by), "fallbacks." + fallback.name + ".shown_by", fallback.shown_by);
  }
  for (StopConfig& stop : robot.stops)
    add_if(is_shown(stop.shown_by), "stops." + stop.name + ".shown_by", stop.shown_by);
  if (robot.simulation && robot.simulation->mujoco)
    add_if(true, "simulation.mujoco.model", robot.simulation->mujoco->model);
  if (robot.safe_torque_off)
    add_if(!robot.safe_torque_off->file.empty(), "safety.safe_torque_off.file", robot.safe_torque_off->file);
  return paths;
}

// Shells expand it, this loader does not: a folder named ~ would be made.
void refuse_home_folders(RobotConfig& robot, Checker& checker) {
  std::vector<WrittenPath> paths = paths_of(robot);
  paths.push_back({"record.directory", &robot.record.directory});
  for (const auto& [key, text] : paths)
    if (const std::size_t slash = text->find('/'); text->starts_with('~') && slash != std::string::npos)
      checker.require(false, key, "~ is not expanded; write /home/NAME" + text->substr(slash));
}

enum class Origin : std::uint8_t {
  written,
  recorded
};  // the latter: of a run folder, whose paths were taken as they are

std::expected<RobotConfig, std::string> robot_of(Node root, const std::string& name_for_messages, Problems& problems,
                                                 Origin origin) {
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
  Checker checker(places, problems);
  if (origin == Origin::written) refuse_home_folders(robot, checker);
  if (!problems.empty()) return std::unexpected(problems.text());

  seal(robot);
  for (const WrittenPath& path : paths_of(robot)) *path.text = absolute_path(*path.text, robot.file);
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
                                               Origin origin) {
  Problems problems(name_for_messages);
  Node root = read_document(text, Tags::refuse, problems);
  if (problems.empty()) expect_kind(root, kSchemaName, name_for_messages, problems);
  if (!problems.empty()) return std::unexpected(problems.text());
  if (origin == Origin::recorded)
    migrate_recorded(root);
  else
    add_base(root, name_for_messages, problems);
  if (!problems.empty()) return std::unexpected(problems.text());
  return robot_of(std::move(root), name_for_messages, problems, origin);
}

}  // namespace

std::expected<RobotConfig, std::string> parse(std::string_view text, const std::string& name_for_messages) {
  return parsed(text, name_for_messages, Origin::written);
}

std::expected<RobotConfig, std::string> parse_recorded(std::string_view text, const std::string& name_for_messages) {
  return parsed(text, name_for_messages, Origin::recorded);
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
  return robot_of(std::move(root), robot.file, problems, Origin::written);
}

std::expected<RobotConfig, std::string> load(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return std::unexpected(text.error());
  return parse(*text, path);
}

}  // namespace takt::config
