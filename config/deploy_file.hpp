// SPDX-License-Identifier: Apache-2.0
// The deploy.yaml that Isaac Lab based tools (Unitree RL Lab's exporter) write beside an exported policy: what it says,
// as values; likewise the files that rl_sar, legged_rl_deploy and unitree_rl_gym read. Python tags in them are
// data and are never executed.
//
// Orders, as that exporter writes them: `joint_ids_map[k]` is the motor slot of the policy's joint k; stiffness and
// damping are in the slots' order; default_joint_pos, action scale and offset are in the policy's. A robot with fewer
// joints than its maker's largest leaves slots free: the robot's order is that of its slots, without the free ones.
// Angles rad, gains Nm/rad and Nms/rad, step_dt s. Other exports are brought into the same form; what they do not say
// is an empty list, or not a number where only some joints are spoken of. Errors: one line per problem,
// "file:line:column: what; how to correct it".
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::config {

struct DeployTerm {
  std::string name;                   // "joint_pos_rel"
  std::vector<double> scale;          // one per value; empty: not said, or 1 (is_unscaled)
  std::uint32_t history = 1;          // 0: not said
  bool is_only_named = false;         // the name is its author's choice, and does not say what is observed
  bool is_unscaled = false;           // `scale: null`: each value as it is
  std::vector<std::size_t> joints{};  // of each value, robot's order; empty: as the policy's
  Duration gait_period{};             // 0: not said
  std::vector<double> clip{};         // lowest and highest value, before the scale; empty: none
  std::string text{};     // what stands behind `term:`, where the export says more than a name; empty: by the name
  std::string comment{};  // beside it
};

// An export that speaks of its tensors: they are named, and gives targets as they are.
struct DeployTensors {
  std::string input, output;                                 // as policy.input and policy.output
  std::string action_kind;                                   // "joint_position"
  std::vector<std::pair<std::string, std::string>> outputs;  // key of policy.action.outputs, name
  std::vector<std::size_t> action_joints;                    // robot's order; empty: as the policy's
  std::uint32_t steps = 1;
  Duration step_period;              // of a chunk; 0: not said
  std::vector<std::string> sensors;  // entries of `sensors`, each a line or more
  bool needs_imu = false;
};

struct DeployFile {
  std::vector<std::size_t> robot_joint;             // of each policy joint, in the robot's order; a permutation
  std::vector<std::size_t> slot;                    // of each of the robot's joints; ascending
  Duration step_dt;                                 // 0: not said
  std::vector<double> stiffness, damping;           // robot's order
  std::vector<double> torque;                       // likewise, Nm; empty: not said
  std::vector<double> default_position;             // policy's order
  std::vector<double> action_scale, action_offset;  // likewise, or one for all; empty: not said
  std::vector<std::size_t> action_joints;           // of each output, robot's order; empty: as the policy's
  std::string action_kind = "joint_position";       // as policy.action.kind
  std::vector<std::string> inputs;                  // that the terms fill, one after the other; empty: the only one
  bool history_by_time = false;                     // all terms of an instant together, else each term's history
  bool newest_first = false;                        // of a history
  std::vector<DeployTerm> terms;
  std::vector<std::pair<std::string, std::pair<double, double>>>
      command_ranges;                // "lin_vel_x", [min, max]; NaN: not said
  std::vector<std::string> notes;    // what the file asks for and an import does not carry over
  std::vector<std::string> remarks;  // what is to be known of what it does carry over
  std::optional<DeployTensors> tensors;
};

// `inputs`: the network's, by name, where its file is at hand: of several groups of observations those that are called
// so fill them, in the network's order.
std::expected<DeployFile, std::string> read_deploy_file(std::string_view text, const std::string& name_for_messages,
                                                        const std::vector<std::string>& inputs = {});

}  // namespace takt::config
