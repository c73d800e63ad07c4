// SPDX-License-Identifier: Apache-2.0
// unitree_rl_gym's deployment programs build the observation themselves, always in one way; their files say its scales.
// Joints stand in the motors' order, unless leg_joint2motor_idx says another.
#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>

#include "config/export_reader.hpp"

namespace takt::config {
namespace {

// Values of one instant beside joints: angular velocity, gravity, command; sine and cosine of the phase.
constexpr double kWithoutJoints = 9, kPhase = 2, kPerJoint = 3;
constexpr Duration kGaitPeriod = milliseconds(800);  // a constant of those programs

class RlGymReader : private ExportReader {
 public:
  explicit RlGymReader(Problems& problems) : ExportReader(problems) {}

  DeployFile read(const Node& root) {
    DeployFile file;
    const double actions = number(root, "num_actions").value_or(0);
    read_joints(root, actions, file);
    read_period(root, file);
    file.default_position = numbers(root, "default_angles", file.slot.size(), "num_actions");
    file.stiffness = in_robot_order(numbers(root, "kps", file.slot.size(), "num_actions"), file);
    file.damping = in_robot_order(numbers(root, "kds", file.slot.size(), "num_actions"), file);
    if (const auto scale = number(root, "action_scale")) file.action_scale = {*scale};
    file.action_offset = file.default_position;
    read_terms(root, actions, file);
    note_of_program(root,
                    {"policy_path", "xml_path", "simulation_duration", "msg_type", "imu_type", "lowcmd_topic",
                     "lowstate_topic", "cmd_init"},
                    file);
    note_others(root,
                {"num_actions",
                 "num_obs",
                 "kps",
                 "kds",
                 "default_angles",
                 "leg_joint2motor_idx",
                 "control_dt",
                 "simulation_dt",
                 "control_decimation",
                 "action_scale",
                 "ang_vel_scale",
                 "dof_pos_scale",
                 "dof_vel_scale",
                 "cmd_scale",
                 "max_cmd",
                 "policy_path",
                 "xml_path",
                 "simulation_duration",
                 "msg_type",
                 "imu_type",
                 "lowcmd_topic",
                 "lowstate_topic",
                 "cmd_init"},
                "", file);
    return file;
  }

 private:
  void read_joints(const Node& root, double actions, DeployFile& file) {
    std::vector<double> slots;
    const Node* const motors = root.find("leg_joint2motor_idx");
    constexpr double most = 1000;
    if (motors != nullptr)
      slots = numbers(root, "leg_joint2motor_idx", 0, "num_actions");
    else
      for (double slot = 0; slot < actions && slot < most; ++slot) slots.push_back(slot);
    if (actions < 1 || static_cast<double>(slots.size()) != actions)
      return problems_.add(root.place, "`num_actions` is not the number of joints; export it again");
    read_slots(slots, motors ? motors->place : root.place, motors ? "leg_joint2motor_idx" : "num_actions", file);
  }

  void read_period(const Node& root, DeployFile& file) {
    std::optional<double> seconds;
    if (root.find("control_dt") != nullptr) {
      seconds = number(root, "control_dt");
    } else {
      const auto step = number(root, "simulation_dt"), steps = number(root, "control_decimation");
      if (step && steps) seconds = *step * *steps;
    }
    if (seconds && *seconds > 0) file.step_dt = {std::llround(*seconds * 1e9)};
    if (seconds && file.step_dt.ns <= 0) problems_.add(root.place, "the control period is not positive; write seconds");
  }

  void add_term(const char* name, std::vector<double> scale, DeployFile& file) {
    DeployTerm term;
    term.name = name;
    term.scale = std::move(scale);
    file.terms.push_back(std::move(term));
  }

  std::vector<double> scale_of(const Node& root, std::string_view key, std::size_t count) {
    return std::vector<double>(count, number(root, key).value_or(1));
  }

  void read_terms(const Node& root, double actions, DeployFile& file) {
    const std::size_t joints = file.slot.size();
    add_term("base_ang_vel", scale_of(root, "ang_vel_scale", 3), file);
    add_term("projected_gravity", {1, 1, 1}, file);
    add_term("velocity_commands", numbers(root, "cmd_scale", 3, "a command"), file);
    add_term("joint_pos_rel", scale_of(root, "dof_pos_scale", joints), file);
    add_term("joint_vel_rel", scale_of(root, "dof_vel_scale", joints), file);
    add_term("last_action", std::vector<double>(joints, 1), file);
    const double without = kWithoutJoints + kPerJoint * actions, values = number(root, "num_obs").value_or(without);
    if (values == without + kPhase) {
      add_term("gait_phase", {1, 1}, file);
      file.terms.back().gait_period = kGaitPeriod;
      file.remarks.emplace_back("the gait's period of 0.8 s is that of unitree_rl_gym's program, not of the file");
    } else if (values != without) {
      problems_.add(root.find("num_obs")->place,
                    fmt::format("`num_obs` is {}; unitree_rl_gym's programs observe {} values, or {} with a phase; "
                                "write the robot file by hand",
                                values, without, without + kPhase));
    }
    add_command_ranges(root.find("max_cmd") ? numbers(root, "max_cmd", 3, "a command") : std::vector<double>{}, file);
  }
};

}  // namespace

DeployFile read_rl_gym_file(const Node& root, Problems& problems) {
  return RlGymReader(problems).read(root);
}

}  // namespace takt::config
