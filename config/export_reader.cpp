// SPDX-License-Identifier: Apache-2.0
#include "config/export_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "config/units.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {

const Node* ExportReader::need(const Node& map, std::string_view key, Node::Kind kind) {
  const Node* node = map.find(key);
  if (node && node->kind == kind) return node;
  problems_.add(node ? node->place : map.place,
                fmt::format("`{}` is missing or holds something else than {}; export it again", key, kind_name(kind)));
  return nullptr;
}

std::optional<double> ExportReader::value_of(const Node& node) {
  const auto value = node.kind == Node::Kind::scalar ? parse_number(node.text) : std::unexpected(std::string());
  if (value) return *value;
  problems_.add(node.place, "is not a number; export it again");
  return std::nullopt;
}

std::optional<double> ExportReader::number(const Node& map, std::string_view key) {
  const Node* node = need(map, key, Node::Kind::scalar);
  return node ? value_of(*node) : std::nullopt;
}

std::vector<double> ExportReader::numbers(const Node& map, std::string_view key, std::size_t count,
                                          std::string_view counted_by) {
  std::vector<double> values;
  const Node* node = need(map, key, Node::Kind::sequence);
  if (!node) return values;
  if (count != 0 && node->items.size() != count)
    problems_.add(node->place, fmt::format("`{}` has {} values, {} {}; export it again", key, node->items.size(),
                                           counted_by, count));
  for (const Node& item : node->items) values.push_back(value_of(item).value_or(0));
  return values;
}

void ExportReader::read_slots(const std::vector<double>& slots, Place place, std::string_view key, DeployFile& file) {
  for (const double value : slots) {
    const bool whole = value >= 0 && value < static_cast<double>(kMaxJoints) && value == std::floor(value);
    const auto slot = static_cast<std::size_t>(whole ? value : 0);
    if (!whole || std::ranges::find(file.slot, slot) != file.slot.end()) {
      problems_.add(place, fmt::format("{} must name a slot of 0..{} for each joint, none twice; export it again", key,
                                       kMaxJoints - 1));
      file.slot.clear();
      return;
    }
    file.slot.push_back(slot);
  }
  const std::vector<std::size_t> of_policy = file.slot;
  std::ranges::sort(file.slot);
  for (const std::size_t slot : of_policy)
    file.robot_joint.push_back(static_cast<std::size_t>(std::ranges::lower_bound(file.slot, slot) - file.slot.begin()));
}

std::vector<double> ExportReader::in_robot_order(const std::vector<double>& of_policy, const DeployFile& file) {
  if (of_policy.size() != file.robot_joint.size()) return {};
  std::vector<double> of_robot(of_policy.size());
  for (std::size_t k = 0; k < of_policy.size(); ++k) of_robot[file.robot_joint[k]] = of_policy[k];
  return of_robot;
}

void ExportReader::add_command_ranges(const std::vector<double>& most, DeployFile& file) {
  std::size_t i = 0;
  for (const char* const name : {"lin_vel_x", "lin_vel_y", "ang_vel_z"}) {
    const double end = i < most.size() ? std::abs(most[i]) : std::numeric_limits<double>::quiet_NaN();
    file.command_ranges.push_back({name, {-end, end}});
    ++i;
  }
}

std::string ExportReader::joints_text(const Node* list) {
  constexpr std::size_t kNamed = 4, kLongest = 64;
  const bool is_list = list != nullptr && list->kind == Node::Kind::sequence && !list->items.empty();
  if (!is_list || list->items.front().kind != Node::Kind::scalar) return "all joints";
  std::string text = list->items.size() == 1 ? "joint " : "joints ";
  for (std::size_t i = 0; i < std::min(list->items.size(), kNamed); ++i)
    text += (i == 0 ? "" : ", ") + list->items[i].text.substr(0, kLongest);
  return text + (list->items.size() > kNamed ? ", ..." : "");
}

void ExportReader::note_others(const Node& map, std::initializer_list<std::string_view> known, const std::string& of,
                               DeployFile& file) {
  for (const Entry& entry : map.entries)
    if (std::ranges::find(known, entry.key.text) == known.end() && entry.value.kind != Node::Kind::null)
      file.notes.push_back(fmt::format("{}{}: Takt does not know this key", of, entry.key.text));
}

void ExportReader::note_of_program(const Node& map, std::initializer_list<std::string_view> keys, DeployFile& file) {
  std::vector<std::string_view> there;
  for (const std::string_view key : keys)
    if (map.find(key) != nullptr) there.push_back(key);
  if (!there.empty())
    file.notes.push_back(fmt::format("{}: of the program that reads this file", fmt::join(there, ", ")));
}

}  // namespace takt::config
