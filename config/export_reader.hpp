// SPDX-License-Identifier: Apache-2.0
// Values by key of an exported YAML, each problem with its place: what the readers of the exports share.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/deploy_file.hpp"
#include "config/document.hpp"

namespace takt::config {

class ExportReader {
 public:
  explicit ExportReader(Problems& problems) : problems_(problems) {}

 protected:
  // Null, and a problem: the key is missing, or holds something else.
  const Node* need(const Node& map, std::string_view key, Node::Kind kind);
  std::optional<double> value_of(const Node& node);
  std::optional<double> number(const Node& map, std::string_view key);
  // `count` 0: any number of them. `counted_by`: the key that says how many.
  std::vector<double> numbers(const Node& map, std::string_view key, std::size_t count, std::string_view counted_by);
  // The order of the robot's joints by the motor slot of each of the policy's; `key` says the slots.
  void read_slots(const std::vector<double>& slots, Place place, std::string_view key, DeployFile& file);
  // Of the policy's order in the robot's.
  static std::vector<double> in_robot_order(const std::vector<double>& of_policy, const DeployFile& file);
  // Of a command of velocities ahead, to the left and of turning: plus and minus `most`; empty: not said.
  static void add_command_ranges(const std::vector<double>& most, DeployFile& file);
  // Of a list of numbers or names: "joint 3", "joints 3, 7, ..."; the list is null or no list: "all joints".
  static std::string joints_text(const Node* list);
  // Keys that are not `known` are named as lost.
  static void note_others(const Node& map, std::initializer_list<std::string_view> known, const std::string& of,
                          DeployFile& file);
  // Those of `keys` that are there: about the program that read the export, not about the robot.
  static void note_of_program(const Node& map, std::initializer_list<std::string_view> keys, DeployFile& file);

  Problems& problems_;
};

// The configuration of unitree_rl_gym's deployment programs (deploy_mujoco, deploy_real), known by `kps`.
DeployFile read_rl_gym_file(const Node& root, Problems& problems);

// rl_sar's config.yaml: one section ROBOT/POLICY. Null: the file is none.
const Node* section_of_rl_sar(const Node& root);
DeployFile read_rl_sar_file(const Node& section, Problems& problems);

// legged_rl_deploy's config.yaml: its section `policy`. Null: the file is none.
const Node* policy_of_legged_rl(const Node& root);
DeployFile read_legged_rl_file(const Node& root, const Node& policy, Problems& problems);

}  // namespace takt::config
