// SPDX-License-Identifier: Apache-2.0
// rl_sar: lists of joints stand in the policy's order, and joint_mapping says the motor of each. An observation is
// clipped after its scale, an action before it.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/export_reader.hpp"
#include "config/exported_name.hpp"
#include "config/robot_config.hpp"

namespace takt::config {
namespace {

class RlSarReader : private ExportReader {
 public:
  explicit RlSarReader(Problems& problems) : ExportReader(problems) {}

  DeployFile read(const Node& section) {
    DeployFile file;
    read_joints(section, file);
    joints_ = file.slot.size();
    if (number(section, "num_of_dofs").value_or(0) != static_cast<double>(joints_))
      problems_.add(section.place, "`num_of_dofs` is not the number of joints in joint_mapping; export it again");
    read_period(section, file);
    file.default_position = by_joint(section, "default_dof_pos");
    file.stiffness = in_robot_order(by_joint(section, "rl_kp"), file);
    file.damping = in_robot_order(by_joint(section, "rl_kd"), file);
    if (section.find("torque_limits") != nullptr)
      file.torque = in_robot_order(by_joint(section, "torque_limits"), file);
    file.action_scale = by_joint(section, "action_scale");
    file.action_offset = file.default_position;
    refuse_wheels(section);
    read_history(section, file);
    read_terms(section, file);
    add_command_ranges({}, file);
    if (section.find("clip_actions_lower") != nullptr || section.find("clip_actions_upper") != nullptr)
      file.notes.emplace_back("clip_actions_lower, clip_actions_upper: set the joints' limits so that they cover them");
    if (section.find("fixed_kp") != nullptr || section.find("fixed_kd") != nullptr)
      file.notes.emplace_back(
          "fixed_kp, fixed_kd: gains while it stands up by itself, which Takt leaves to the policy");
    note_of_program(section, {"model_name", "joint_names", "joint_controller_names", "framework"}, file);
    note_others(section,
                {"model_name",
                 "framework",
                 "num_observations",
                 "observations",
                 "observations_history",
                 "observations_history_priority",
                 "clip_obs",
                 "clip_actions_lower",
                 "clip_actions_upper",
                 "rl_kp",
                 "rl_kd",
                 "fixed_kp",
                 "fixed_kd",
                 "num_of_dofs",
                 "action_scale",
                 "wheel_indices",
                 "lin_vel_scale",
                 "ang_vel_scale",
                 "dof_pos_scale",
                 "dof_vel_scale",
                 "commands_scale",
                 "torque_limits",
                 "default_dof_pos",
                 "joint_mapping",
                 "state_mapping",
                 "command_mapping",
                 "joint_names",
                 "joint_controller_names",
                 "dt",
                 "decimation"},
                "", file);
    return file;
  }

 private:
  std::vector<double> by_joint(const Node& section, std::string_view key) {
    return numbers(section, key, joints_, "joint_mapping");
  }

  // Earlier versions name the motor of each joint in state_mapping, and the joint of each motor in command_mapping.
  void read_joints(const Node& section, DeployFile& file) {
    const bool is_earlier = section.find("joint_mapping") == nullptr && section.find("state_mapping") != nullptr;
    const std::string_view key = is_earlier ? "state_mapping" : "joint_mapping";
    const Node* const mapping = section.find(key);
    const Place place = mapping ? mapping->place : section.place;
    const std::vector<double> slots = numbers(section, key, 0, "num_of_dofs");
    read_slots(slots, place, key, file);
    if (!is_earlier || section.find("command_mapping") == nullptr) return;
    const std::vector<double> back = numbers(section, "command_mapping", slots.size(), "state_mapping");
    for (std::size_t joint = 0; joint < file.slot.size() && back.size() == slots.size(); ++joint)
      if (slots[joint] >= static_cast<double>(back.size()) ||
          back[static_cast<std::size_t>(slots[joint])] != static_cast<double>(joint))
        return problems_.add(place,
                             "state_mapping and command_mapping are not each other's inverse: a joint is read at one "
                             "motor and moved at another; export it again");
  }

  void read_period(const Node& section, DeployFile& file) {
    if (section.find("dt") == nullptr || section.find("decimation") == nullptr) return;  // in base.yaml
    const double seconds = number(section, "dt").value_or(0) * number(section, "decimation").value_or(0);
    if (seconds > 0 && std::isfinite(seconds)) file.step_dt = {std::llround(seconds * 1e9)};
    if (file.step_dt.ns <= 0) problems_.add(section.place, "dt times decimation is not positive; write seconds");
  }

  void refuse_wheels(const Node& section) {
    const Node* const wheels = section.find("wheel_indices");
    if (wheels != nullptr && wheels->kind == Node::Kind::sequence && !wheels->items.empty())
      problems_.add(wheels->place,
                    fmt::format("wheel_indices moves {} by velocity and the rest by position, and all outputs of a "
                                "policy have one kind in a robot file; train with one kind",
                                joints_text(wheels)));
  }

  // Which instants one input has, 0 the newest, in its order.
  void read_history(const Node& section, DeployFile& file) {
    const Node* const history = section.find("observations_history");
    if (history == nullptr || history->items.empty()) return;
    const std::vector<double> instants = numbers(section, "observations_history", 0, "");
    const auto counts = [&](double first, double step) {
      for (std::size_t i = 0; i < instants.size(); ++i)
        if (instants[i] != first + step * static_cast<double>(i)) return false;
      return true;
    };
    const auto last = static_cast<double>(instants.size()) - 1;
    file.newest_first = counts(0, 1) && last > 0;
    if (instants.size() > kMostHistory || (!counts(0, 1) && !counts(last, -1)))
      problems_.add(history->place,
                    fmt::format("observations_history is no count from 0 up or down, of at most {}; a robot file keeps "
                                "whole histories",
                                kMostHistory));
    history_ = static_cast<std::uint32_t>(std::min<std::size_t>(instants.size(), kMostHistory));
    const Node* const priority = section.find("observations_history_priority");
    file.history_by_time = priority == nullptr || priority->text != "term";
  }

  DeployTerm term_of(const Node& section, const Node& name) {
    const auto scaled = [&](const char* term, std::string_view key, std::size_t count) {
      DeployTerm made;
      made.name = term;
      made.scale = std::vector<double>(count, key.empty() ? 1 : number(section, key).value_or(1));
      return made;
    };
    const std::string& text = name.text;
    if (text == "lin_vel") return scaled("lin_vel", "lin_vel_scale", 3);
    if (text == "ang_vel" || text == "ang_vel_body") return scaled("base_ang_vel", "ang_vel_scale", 3);
    if (text == "gravity_vec") return scaled("projected_gravity", "", 3);
    if (text == "dof_pos") return scaled("joint_pos_rel", "dof_pos_scale", joints_);
    if (text == "dof_vel") return scaled("joint_vel_rel", "dof_vel_scale", joints_);
    if (text == "actions") return scaled("last_action", "", joints_);
    if (text == "g1_phase" || text == "phase") return scaled("gait_phase", "", 2);
    DeployTerm term;
    term.name = text == "commands" ? "velocity_commands" : text;
    if (text != "commands") term.is_unscaled = true;
    if (text == "commands") term.scale = numbers(section, "commands_scale", 3, "a command");
    return term;
  }

  // A bound behind one scale is one before it, divided.
  void clip(const Node& section, DeployTerm& term, DeployFile& file) {
    if (section.find("clip_obs") == nullptr) return;
    const double bound = number(section, "clip_obs").value_or(0);
    const double scale = term.is_unscaled || term.scale.empty() ? 1 : term.scale.front();
    if (bound > 0 && scale > 0 && std::ranges::all_of(term.scale, [&](double one) { return one == scale; }))
      term.clip = {-bound / scale, bound / scale};
    else
      file.notes.push_back(fmt::format("clip_obs of {}: its values differ in scale", term.name));
  }

  void read_terms(const Node& section, DeployFile& file) {
    const Node* const names = need(section, "observations", Node::Kind::sequence);
    if (names == nullptr) return;
    std::size_t values = 0;
    bool all_known = true;
    for (const Node& name : names->items) {
      if (const std::string why = why_no_name(name.text); name.kind != Node::Kind::scalar || !why.empty()) {
        problems_.add(name.place, fmt::format("observation {}", why.empty() ? "is no name; export it again" : why));
        continue;
      }
      DeployTerm term = term_of(section, name);
      term.history = history_;
      clip(section, term, file);
      all_known = all_known && !term.is_unscaled;
      values += term.scale.size();
      file.terms.push_back(std::move(term));
    }
    const double said = number(section, "num_observations").value_or(0);
    const auto counted = static_cast<double>(values);
    if (all_known && said != counted && said != counted * history_)
      problems_.add(
          section.find("num_observations")->place,
          fmt::format("`num_observations` is {}, its observations have {} values; export it again", said, counted));
  }

  std::size_t joints_ = 0;
  std::uint32_t history_ = 1;
};

}  // namespace

const Node* section_of_rl_sar(const Node& root) {
  for (const Entry& entry : root.entries)
    if (entry.key.text.contains('/') && entry.value.find("rl_kp") != nullptr) return &entry.value;
  return nullptr;
}

DeployFile read_rl_sar_file(const Node& section, Problems& problems) {
  return RlSarReader(problems).read(section);
}

}  // namespace takt::config
