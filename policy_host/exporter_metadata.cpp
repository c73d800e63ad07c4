// SPDX-License-Identifier: Apache-2.0
#include "policy_host/exporter_metadata.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "config/exported_name.hpp"
#include "config/robot_text.hpp"

namespace takt::policy_host {
namespace {

constexpr double kMostHistory = 64;  // as policy.observation[].history

std::vector<std::string> items_of(std::string_view list) {
  std::vector<std::string> items;
  while (!list.empty()) {
    const std::size_t end = std::min(list.find(','), list.size());
    std::string_view item = list.substr(0, end);
    while (item.starts_with(' ')) item.remove_prefix(1);
    while (item.ends_with(' ')) item.remove_suffix(1);
    items.emplace_back(item);
    list.remove_prefix(std::min(end + 1, list.size()));
  }
  return items;
}

std::size_t decimals(const std::string& number) {
  const std::size_t point = number.find('.');
  return point == std::string::npos ? 0 : number.size() - point - 1;
}

class NumberLists {
 public:
  std::vector<double> read(const std::string& key, const std::string& list) {
    std::vector<double> numbers;
    for (const std::string& item : items_of(list)) {
      double number = 0;
      const auto [end, error] = std::from_chars(item.data(), item.data() + item.size(), number);
      if (error != std::errc() || end != item.data() + item.size() || !std::isfinite(number)) {
        problem =
            fmt::format("metadata {}: '{}' is not a number; export the policy again", key, config::on_one_line(item));
      }
      most_decimals = std::max(most_decimals, decimals(item));
      numbers.push_back(number);
    }
    return numbers;
  }

  std::string problem;
  std::size_t most_decimals = 0;
};

// Nothing: it can stand in a robot file.
std::string unfit(const ExporterMetadata& metadata) {
  const std::size_t joints = metadata.joint_names.size();
  if (joints == 0)
    return "holds no metadata of mjlab's or whole_body_tracking's exporters (joint_names); import the deploy.yaml "
           "beside it";
  for (const auto& [key, list] :
       {std::pair{"joint_stiffness", &metadata.stiffness}, std::pair{"joint_damping", &metadata.damping},
        std::pair{"default_joint_pos", &metadata.default_position}}) {
    if (list->empty()) return fmt::format("metadata: {} is missing; export the policy again", key);
  }
  if (!metadata.action_joints.empty() && metadata.action_joints != metadata.joint_names)
    return fmt::format(
        "metadata: the policy moves {} of {} joints (action_joint_names), which is not imported; write "
        "policy.action.joints by hand",
        metadata.action_joints.size(), joints);
  for (const auto* list : {&metadata.action_scale, &metadata.action_offset}) {
    if (list->size() > 1 && list->size() != joints)
      return fmt::format("metadata: {} action scales or offsets for {} joints; export the policy again", list->size(),
                         joints);
  }
  if (!metadata.history_lengths.empty() && metadata.history_lengths.size() != metadata.observation_names.size())
    return fmt::format("metadata: {} observation_history_lengths for {} observations; export the policy again",
                       metadata.history_lengths.size(), metadata.observation_names.size());
  for (const double length : metadata.history_lengths)
    if (length < 0 || length > kMostHistory || length != std::floor(length))
      return fmt::format("metadata: an observation_history_length of {:g}, which a robot file does not hold (0 to {})",
                         length, kMostHistory);
  return "";
}

std::vector<double> in_robot_order(const std::vector<double>& of_policy, const std::vector<std::size_t>& robot_joint) {
  std::vector<double> values(of_policy.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[robot_joint[k]] = of_policy[k];
  return values;
}

}  // namespace

std::expected<ExporterMetadata, std::string> read_exporter_metadata(
    const std::vector<std::pair<std::string, std::string>>& metadata) {
  ExporterMetadata read;
  NumberLists numbers;
  std::string unfit;
  const auto names_of = [&](const std::string& key, const std::string& list) {
    std::vector<std::string> names = items_of(list);
    for (const std::string& name : names)
      if (const std::string why = config::why_no_name(name); !why.empty())
        unfit = fmt::format("metadata {}: {}; rename it and export the policy again", key, why);
    return names;
  };
  for (const auto& [key, value] : metadata) {
    if (key == "joint_names") read.joint_names = names_of(key, value);
    if (key == "observation_names") read.observation_names = names_of(key, value);
    if (key == "joint_stiffness") read.stiffness = numbers.read(key, value);
    if (key == "joint_damping") read.damping = numbers.read(key, value);
    if (key == "default_joint_pos") read.default_position = numbers.read(key, value);
    if (key == "action_scale") read.action_scale = numbers.read(key, value);
    if (key == "action_offset") read.action_offset = numbers.read(key, value);
    if (key == "action_joint_names") read.action_joints = names_of(key, value);
    if (key == "observation_history_lengths") read.history_lengths = numbers.read(key, value);
  }
  if (read.joint_names.empty()) return ExporterMetadata{};
  if (!unfit.empty()) return std::unexpected(unfit);
  if (!numbers.problem.empty()) return std::unexpected(numbers.problem);
  for (const auto* list : {&read.stiffness, &read.damping, &read.default_position}) {
    if (list->empty() || list->size() == read.joint_names.size()) continue;
    return std::unexpected(fmt::format("metadata: a list of {} numbers for {} joints; export the policy again",
                                       list->size(), read.joint_names.size()));
  }
  read.rounded = numbers.most_decimals <= 3;
  return read;
}

std::expected<config::DeployFile, std::string> deploy_file_of(const ExporterMetadata& metadata,
                                                              const std::vector<std::string>& robot_joints) {
  if (std::string reason = unfit(metadata); !reason.empty()) return std::unexpected(std::move(reason));
  config::DeployFile file;
  for (const std::string& joint : metadata.joint_names) {
    const auto found = std::ranges::find(robot_joints, joint);
    if (found == robot_joints.end() || robot_joints.size() != metadata.joint_names.size()) {
      return std::unexpected(fmt::format("metadata: joints {}; the robot's are {}: name all and no others",
                                         fmt::join(metadata.joint_names, ", "), fmt::join(robot_joints, ", ")));
    }
    file.slot.push_back(file.slot.size());
    file.robot_joint.push_back(static_cast<std::size_t>(found - robot_joints.begin()));
  }
  file.stiffness = in_robot_order(metadata.stiffness, file.robot_joint);
  file.damping = in_robot_order(metadata.damping, file.robot_joint);
  file.default_position = metadata.default_position;
  file.action_scale = metadata.action_scale;
  file.action_offset = metadata.action_offset;
  for (std::size_t each = 0; each < metadata.observation_names.size(); ++each) {
    const double history = metadata.history_lengths.empty() ? 0 : std::max(metadata.history_lengths[each], 1.0);
    file.terms.push_back({metadata.observation_names[each], {}, static_cast<std::uint32_t>(history), true});
  }
  if (metadata.rounded)
    file.remarks.emplace_back("gains, poses and scales have three decimals at most: the exporter rounded them");
  return file;
}

}  // namespace takt::policy_host
