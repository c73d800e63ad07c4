#include "config/deploy_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/document.hpp"
#include "config/exported_name.hpp"
#include "config/units.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {
namespace {

constexpr std::uint32_t kMostHistory = 64;  // as policy.observation[].history

class DeployReader {
 public:
  explicit DeployReader(Problems& problems) : problems_(problems) {}

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
    return file;
  }

 private:
  const Node* need(const Node& map, std::string_view key, Node::Kind kind) {
    const Node* node = map.find(key);
    if (node && node->kind == kind) return node;
    problems_.add(
        node ? node->place : map.place,
        fmt::format("`{}` is missing or holds something else than {}; export it again", key, kind_name(kind)));
    return nullptr;
  }

  void refuse_unfit(const Node& key, std::string_view what) {
    if (const std::string why = why_no_name(key.text); !why.empty())
      problems_.add(key.place, fmt::format("{} {}", what, why));
  }

  std::optional<double> value_of(const Node& node) {
    const auto value = node.kind == Node::Kind::scalar ? parse_number(node.text) : std::unexpected(std::string());
    if (value) return *value;
    problems_.add(node.place, "is not a number; export it again");
    return std::nullopt;
  }

  std::optional<double> number(const Node& map, std::string_view key) {
    const Node* node = need(map, key, Node::Kind::scalar);
    return node ? value_of(*node) : std::nullopt;
  }

  std::vector<double> numbers(const Node& map, std::string_view key, std::size_t count) {
    std::vector<double> values;
    const Node* node = need(map, key, Node::Kind::sequence);
    if (!node) return values;
    if (count != 0 && node->items.size() != count)
      problems_.add(node->place, fmt::format("`{}` has {} values, joint_ids_map {}; export it again", key,
                                             node->items.size(), count));
    for (const Node& item : node->items) values.push_back(value_of(item).value_or(0));
    return values;
  }

  void read_joints(const Node& root, DeployFile& file) {
    const std::vector<double> map = numbers(root, "joint_ids_map", 0);
    for (const double value : map) {
      const bool whole = value >= 0 && value < static_cast<double>(kMaxJoints) && value == std::floor(value);
      const auto slot = static_cast<std::size_t>(whole ? value : 0);
      if (!whole || std::ranges::find(file.slot, slot) != file.slot.end()) {
        problems_.add(root.find("joint_ids_map")->place,
                      fmt::format("joint_ids_map must name a slot of 0..{} for each joint, none twice; export it again",
                                  kMaxJoints - 1));
        file.slot.clear();
        return;
      }
      file.slot.push_back(slot);
    }
    const std::vector<std::size_t> of_policy = file.slot;
    std::ranges::sort(file.slot);
    for (const std::size_t slot : of_policy)
      file.robot_joint.push_back(
          static_cast<std::size_t>(std::ranges::lower_bound(file.slot, slot) - file.slot.begin()));
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

  void read_action(const Node& root, DeployFile& file, std::size_t joints) {
    const Node* actions = need(root, "actions", Node::Kind::map);
    if (!actions) return;
    for (const auto& [key, value] : actions->entries) {
      refuse_unfit(key, "action");
      if (key.text != "JointPositionAction")
        problems_.add(key.place,
                      fmt::format("action `{}` is not supported; Takt imports JointPositionAction", key.text));
    }
    const Node* action = need(*actions, "JointPositionAction", Node::Kind::map);
    if (!action) return;
    file.action_scale = numbers(*action, "scale", joints);
    file.action_offset = numbers(*action, "offset", joints);
    note_clip(*action, "JointPositionAction", file);
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
    for (const auto& [key, value] : observations->entries) {
      DeployTerm term;
      term.name = key.text;
      refuse_unfit(key, "observation");
      if (value.kind != Node::Kind::map) {
        problems_.add(value.place, fmt::format("observation `{}` is no section; export it again", key.text));
        continue;
      }
      term.scale = numbers(value, "scale", 0);
      if (const Node* history = value.find("history_length"); history && history->kind == Node::Kind::scalar)
        term.history = history_of(*history);
      // unitree_rl_lab clips before it scales, unless told otherwise.
      if (const Node* first = value.find("scale_first"); first && first->text == "true") {
        note_clip(value, key.text, file);
      } else if (const Node* clip = value.find("clip"); clip && clip->kind != Node::Kind::null) {
        term.clip = numbers(value, "clip", 2);
      }
      file.terms.push_back(std::move(term));
    }
  }

  Problems& problems_;
};

}  // namespace

std::expected<DeployFile, std::string> read_deploy_file(std::string_view text, const std::string& name_for_messages) {
  Problems problems(name_for_messages);
  const Node root = read_document(text, Tags::read_as_data, problems);
  if (problems.empty() && root.kind != Node::Kind::map)
    problems.add(root.place, "is no deploy.yaml: a section with joint_ids_map, actions and observations is expected");
  if (!problems.empty()) return std::unexpected(problems.text());
  DeployFile file = DeployReader(problems).read(root);
  if (!problems.empty()) return std::unexpected(problems.text());
  return file;
}

}  // namespace takt::config
