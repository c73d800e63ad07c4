// SPDX-License-Identifier: Apache-2.0
#include "config/deploy_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <ranges>

#include "config/document.hpp"
#include "config/export_reader.hpp"
#include "config/exported_name.hpp"
#include "config/robot_config.hpp"
#include "config/units.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {
namespace {

constexpr auto kActions =
    std::to_array<std::pair<std::string_view, std::string_view>>({{"JointPositionAction", "joint_position"},
                                                                  {"JointVelocityAction", "joint_velocity"},
                                                                  {"JointEffortAction", "joint_torque"}});

class DeployReader : private ExportReader {
 public:
  DeployReader(Problems& problems, const std::vector<std::string>& inputs) : ExportReader(problems), inputs_(inputs) {}

  DeployFile read(const Node& root) {
    DeployFile file;
    read_joints(root, file);
    const std::size_t joints = file.robot_joint.size();
    if (const auto dt = number(root, "step_dt")) file.step_dt = {std::llround(*dt * 1e9)};
    if (file.step_dt.ns <= 0) problems_.add(root.place, "step_dt is missing or not positive; write seconds");
    file.stiffness = by_slot(root, "stiffness", file);
    file.damping = by_slot(root, "damping", file);
    file.default_position = numbers(root, "default_joint_pos", joints);
    read_action(root, file, joints);
    read_commands(root, file);
    read_terms(root, file);
    note_others(root,
                {"joint_ids_map", "step_dt", "stiffness", "damping", "default_joint_pos", "commands", "actions",
                 "observations"},
                "", file);
    return file;
  }

 private:
  void refuse_unfit(const Node& key, std::string_view what) {
    if (const std::string why = why_no_name(key.text); !why.empty())
      problems_.add(key.place, fmt::format("{} {}", what, why));
  }

  std::vector<double> numbers(const Node& map, std::string_view key, std::size_t count) {
    return ExportReader::numbers(map, key, count, "joint_ids_map");
  }

  void read_joints(const Node& root, DeployFile& file) {
    const std::vector<double> map = numbers(root, "joint_ids_map", 0);
    const Node* const written = root.find("joint_ids_map");
    read_slots(map, written ? written->place : root.place, "joint_ids_map", file);
  }

  // One value per joint, or one per slot, free ones too.
  std::vector<double> by_slot(const Node& root, std::string_view key, const DeployFile& file) {
    const std::size_t joints = file.slot.size();
    std::vector<double> values = numbers(root, key, 0);
    if (values.empty() || joints == 0 || values.size() == joints) return values;
    if (values.size() <= file.slot.back()) {
      problems_.add(root.find(key)->place,
                    fmt::format("`{}` has {} values, joint_ids_map {} up to slot {}; export it again", key,
                                values.size(), joints, file.slot.back()));
      return {};
    }
    std::vector<double> used;
    for (const std::size_t slot : file.slot) used.push_back(values[slot]);
    return used;
  }

  std::uint32_t history_of(const Node& node) {
    const double length = value_of(node).value_or(0);
    if (length >= 0 && length <= kMostHistory && length == std::floor(length))
      return std::max(static_cast<std::uint32_t>(length), 1U);  // 0: none but the newest
    problems_.add(node.place,
                  fmt::format("history_length must be a whole number to {}; export it again", kMostHistory));
    return 1;
  }

  void note_clip(const Node& map, const std::string& of, DeployFile& file) {
    const Node* clip = map.find("clip");
    if (clip && clip->kind != Node::Kind::null)
      file.notes.push_back(
          fmt::format("{}: clip is not carried over; set the joints' limits so that they cover it", of));
  }

  // Of the policy's joints; those of the robot, in its order. Empty: all, which null, a whole slice or nothing says.
  std::vector<std::size_t> chosen_joints(const Node* list, const DeployFile& file) {
    if (list == nullptr || list->kind == Node::Kind::null) return {};
    if (list->kind != Node::Kind::sequence) {
      problems_.add(list->place, "joint_ids is no list; write numbers of joints, or null for all");
      return {};
    }
    const auto is_null = [](const Node& item) { return item.kind == Node::Kind::null; };
    if (std::ranges::all_of(list->items, is_null)) return {};
    std::vector<std::size_t> joints;
    for (const Node& item : list->items) {
      const double value = value_of(item).value_or(-1);
      const bool is_joint =
          value >= 0 && value < static_cast<double>(file.robot_joint.size()) && value == std::floor(value);
      const std::size_t joint = is_joint ? file.robot_joint[static_cast<std::size_t>(value)] : 0;
      if (!is_joint || std::ranges::find(joints, joint) != joints.end()) {
        problems_.add(item.place, fmt::format("joint_ids must name joints of 0..{}, none twice; export it again",
                                              file.robot_joint.size() - 1));
        return {};
      }
      joints.push_back(joint);
    }
    return joints == file.robot_joint ? std::vector<std::size_t>{} : joints;
  }

  // `null` says that nothing is scaled, or moved.
  std::vector<double> numbers_or(const Node& map, std::string_view key, std::size_t count,
                                 std::vector<double> by_null) {
    const Node* node = map.find(key);
    if (node && node->kind == Node::Kind::null) return by_null;
    if (node && node->kind == Node::Kind::scalar) return std::vector<double>(count, value_of(*node).value_or(0));
    return numbers(map, key, count);
  }

  static std::string kind_of_action(std::string_view name) {
    const auto* const found = std::ranges::find(kActions, name, &std::pair<std::string_view, std::string_view>::first);
    return found == kActions.end() ? "" : std::string(found->second);
  }

  void read_action(const Node& root, DeployFile& file, std::size_t joints) {
    const Node* actions = need(root, "actions", Node::Kind::map);
    if (!actions) return;
    for (const auto& [key, value] : actions->entries) {
      refuse_unfit(key, "action");
      if (kind_of_action(key.text).empty())
        problems_.add(key.place, fmt::format("action `{}` is none of {}; Takt has no outputs of that meaning", key.text,
                                             fmt::join(kActions | std::views::keys, ", ")));
    }
    if (actions->entries.empty()) need(*actions, "JointPositionAction", Node::Kind::map);
    if (actions->entries.empty()) return;
    if (actions->entries.size() > 1) {
      const Entry &first = actions->entries[0], &second = actions->entries[1];
      const auto joints_of = [](const Entry& entry) {
        const Node* const names = entry.value.find("joint_names");
        return joints_text(names && names->kind == Node::Kind::sequence ? names : entry.value.find("joint_ids"));
      };
      problems_.add(second.key.place,
                    fmt::format("actions.{} ({}) is beside actions.{} ({}), and all outputs of a policy have one kind "
                                "in a robot file; train with one kind",
                                second.key.text, joints_of(second), first.key.text, joints_of(first)));
      return;
    }
    const auto& [name, section] = actions->entries.front();
    file.action_kind = kind_of_action(name.text);
    const Node* action = need(*actions, name.text, Node::Kind::map);
    if (!action || file.action_kind.empty()) return;
    file.action_joints = chosen_joints(action->find("joint_ids"), file);
    const std::size_t outputs = file.action_joints.empty() ? joints : file.action_joints.size();
    file.action_scale = numbers_or(*action, "scale", outputs, {1});
    file.action_offset = numbers_or(*action, "offset", outputs, std::vector<double>(outputs, 0));
    if (file.action_kind != "joint_position" &&
        std::ranges::any_of(file.action_offset, [](double one) { return one != 0; }))
      problems_.add(action->place,
                    fmt::format("{} has an offset, and velocities and torques start from zero in a robot "
                                "file; train without",
                                name.text));
    note_clip(*action, name.text, file);
    note_others(*action, {"scale", "offset", "clip", "joint_ids", "joint_names"}, name.text + ".", file);
  }

  void read_commands(const Node& root, DeployFile& file) {
    const Node* commands = root.find("commands");
    const Node* velocity = commands ? commands->find("base_velocity") : nullptr;
    const Node* ranges = velocity ? velocity->find("ranges") : nullptr;
    if (!ranges) return;
    for (const auto& [key, range] : ranges->entries) {
      if (range.kind == Node::Kind::null) continue;
      refuse_unfit(key, "range");
      const std::vector<double> ends = numbers(*ranges, key.text, 2);
      if (ends.size() == 2 && ends[0] > ends[1])
        problems_.add(range.place, fmt::format("`{}` ends below its beginning; export it again", key.text));
      else if (ends.size() == 2)
        file.command_ranges.push_back({key.text, {ends[0], ends[1]}});
    }
  }

  void read_terms(const Node& root, DeployFile& file) {
    const Node* observations = need(root, "observations", Node::Kind::map);
    if (!observations) return;
    if (const Node* group = only_group(*observations)) return read_group(*group, file);
    const auto is_groups = [](const Entry& entry) { return is_group(entry.value); };
    if (std::ranges::none_of(observations->entries, is_groups)) return read_group(*observations, file);
    read_groups(*observations, file);
  }

  void read_group(const Node& group, DeployFile& file) {
    for (const auto& [key, value] : group.entries) {
      if (key.text == "use_gym_history" && value.kind == Node::Kind::scalar)
        file.history_by_time = value.text == "true";
      else
        read_term(key, value, file);
    }
  }

  // Each that is called as an input of the network fills it; others are of the training.
  void read_groups(const Node& groups, DeployFile& file) {
    std::vector<std::string_view> names;
    for (const Entry& entry : groups.entries) {
      names.emplace_back(entry.key.text);
      if (!is_group(entry.value))
        return problems_.add(entry.key.place,
                             fmt::format("`{}` stands beside groups and is none; export it again", entry.key.text));
    }
    bool by_time = false;
    for (const std::string& input : inputs_) {
      const Node* const group = groups.find(input);
      if (group == nullptr) continue;
      file.inputs.push_back(input);
      read_group(*group, file);
      by_time = by_time || file.history_by_time;
    }
    if (file.inputs.empty())
      return problems_.add(groups.place, fmt::format("observations has several groups ({}), and none is called as an "
                                                     "input of the network is ({}); export the actor's group alone",
                                                     fmt::join(names, ", "), fmt::join(inputs_, ", ")));
    if (by_time && file.inputs.size() > 1)
      problems_.add(groups.place,
                    "use_gym_history of several groups: Takt lays histories out by time over all inputs together; "
                    "export with use_gym_history: false");
    for (const Entry& entry : groups.entries)
      if (std::ranges::find(file.inputs, entry.key.text) == file.inputs.end())
        file.notes.push_back(fmt::format("observations.{}: the network has no input of that name", entry.key.text));
  }

  // Named sections of terms, one for each input of the network.
  static bool is_group(const Node& value) {
    if (value.kind != Node::Kind::map || value.entries.empty() || value.find("scale") || value.find("params"))
      return false;
    return std::ranges::all_of(value.entries, [](const auto& entry) {
      return entry.value.kind == Node::Kind::map || entry.key.text == "use_gym_history";
    });
  }
  static const Node* only_group(const Node& observations) {
    return observations.entries.size() == 1 && is_group(observations.entries.front().value)
               ? &observations.entries.front().value
               : nullptr;
  }

  void read_term(const Node& key, const Node& value, DeployFile& file) {
    DeployTerm term;
    term.name = key.text;
    refuse_unfit(key, "observation");
    if (value.kind != Node::Kind::map) {
      problems_.add(value.place, fmt::format("observation `{}` is no section; export it again", key.text));
      return;
    }
    const Node* scale = value.find("scale");
    term.is_unscaled = scale && scale->kind == Node::Kind::null;
    const std::size_t width = scale && scale->kind == Node::Kind::scalar ? width_of(key.text, file) : 0;
    if (!term.is_unscaled) term.scale = numbers_or(value, "scale", width, {});
    if (term.scale.empty() && width == 0 && scale && scale->kind == Node::Kind::scalar)
      problems_.add(scale->place,
                    fmt::format("one scale for all of `{}`, whose number of values the file does not say; "
                                "write one for each",
                                key.text));
    if (const Node* history = value.find("history_length"); history && history->kind == Node::Kind::scalar)
      term.history = history_of(*history);
    read_params(value.find("params"), term, file);
    read_clip(key, value, term, file);
    note_others(value, {"scale", "params", "clip", "history_length", "scale_first"}, key.text + ".", file);
    file.terms.push_back(std::move(term));
  }

  // 0: the name does not say.
  static std::size_t width_of(std::string_view name, const DeployFile& file) {
    if (name == "base_ang_vel" || name == "projected_gravity" || name == "velocity_commands") return 3;
    return name.starts_with("joint_") || name == "last_action" ? file.slot.size() : 0;
  }

  void read_params(const Node* params, DeployTerm& term, DeployFile& file) {
    if (params == nullptr || params->kind != Node::Kind::map) return;
    if (const Node* asset = params->find("asset_cfg"); asset && asset->kind == Node::Kind::map)
      term.joints = chosen_joints(asset->find("joint_ids"), file);
    note_others(*params, {"asset_cfg", "period", "command_name"}, term.name + ".params.", file);
    const Node* period = params->find("period");
    if (term.name != "gait_phase" || period == nullptr) return;
    const double seconds = value_of(*period).value_or(1);
    if (seconds > 0)
      term.gait_period = {std::llround(seconds * 1e9)};
    else
      problems_.add(period->place, "period is not positive; write seconds");
  }

  // unitree_rl_lab clips before it scales, unless told otherwise; a bound behind one scale is one before it, divided.
  void read_clip(const Node& key, const Node& value, DeployTerm& term, DeployFile& file) {
    const Node* clip = value.find("clip");
    if (clip == nullptr || clip->kind == Node::Kind::null) return;
    const Node* first = value.find("scale_first");
    const bool scales_first = first && first->text == "true" && !term.is_unscaled;
    const auto differs = [&](double one) { return one != term.scale.front(); };
    if (scales_first && (term.scale.empty() || term.scale.front() <= 0 || std::ranges::any_of(term.scale, differs)))
      return note_clip(value, key.text, file);
    term.clip = numbers(value, "clip", 2);
    if (scales_first)
      for (double& bound : term.clip) bound /= term.scale.front();
  }

  const std::vector<std::string>& inputs_;  // the network's
};

}  // namespace

namespace {

bool is_any_export(const Node& root) {
  constexpr std::array<std::string_view, 5> kKnown{"joint_ids_map", "actions", "observations", "kps", "step_dt"};
  return std::ranges::any_of(kKnown, [&](std::string_view key) { return root.find(key) != nullptr; });
}

}  // namespace

std::expected<DeployFile, std::string> read_deploy_file(std::string_view text, const std::string& name_for_messages,
                                                        const std::vector<std::string>& inputs) {
  Problems problems(name_for_messages);
  const Node root = read_document(text, Tags::read_as_data, problems);
  if (problems.empty() && root.kind != Node::Kind::map)
    problems.add(root.place, "is no deploy.yaml: a section with joint_ids_map, actions and observations is expected");
  if (!problems.empty()) return std::unexpected(problems.text());
  const Node* const rl_sar = section_of_rl_sar(root);
  const Node* const legged_rl = policy_of_legged_rl(root);
  if (const Node* const fsm = root.find("fsm"); fsm != nullptr && fsm->find("policies") != nullptr)
    problems.add(fsm->place, "chooses among policies, each of a configuration of its own; import one of those");
  else if (rl_sar == nullptr && legged_rl == nullptr && !is_any_export(root))
    problems.add(
        root.place,
        "is no deploy.yaml (joint_ids_map, actions, observations), and no configuration of rl_sar (one section "
        "ROBOT/POLICY with rl_kp), legged_rl_deploy (policy.joint_ids_map) or unitree_rl_gym (kps)");
  if (!problems.empty()) return std::unexpected(problems.text());
  DeployFile file = rl_sar != nullptr             ? read_rl_sar_file(*rl_sar, problems)
                    : legged_rl != nullptr        ? read_legged_rl_file(root, *legged_rl, problems)
                    : root.find("kps") != nullptr ? read_rl_gym_file(root, problems)
                                                  : DeployReader(problems, inputs).read(root);
  if (!problems.empty()) return std::unexpected(problems.text());
  return file;
}

}  // namespace takt::config
