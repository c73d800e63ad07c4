#include "policy_host/exporter_metadata.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

namespace takt::policy_host {
namespace {

constexpr double kRounding = 0.5e-3 + 1e-9;  // of three decimals

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
        problem = fmt::format("metadata {}: '{}' is not a number; export the policy again", key, item);
      }
      most_decimals = std::max(most_decimals, decimals(item));
      numbers.push_back(number);
    }
    return numbers;
  }

  std::string problem;
  std::size_t most_decimals = 0;
};

// The robot's joints as its policy counts them.
std::vector<const config::Joint*> policy_joints(const config::RobotConfig& robot) {
  std::vector<const config::Joint*> joints;
  for (const std::size_t joint : robot.policy->joint_order) joints.push_back(&robot.joints[joint]);
  if (joints.empty()) {
    for (const config::Joint& joint : robot.joints) joints.push_back(&joint);
  }
  return joints;
}

std::expected<void, std::string> check_order(const ExporterMetadata& metadata, const config::RobotConfig& robot,
                                             const std::vector<const config::Joint*>& joints) {
  if (metadata.joint_names.size() != joints.size()) {
    return std::unexpected(fmt::format("{}: the policy's metadata has {} joints, policy.joint_order {}; mend it",
                                       robot.file, metadata.joint_names.size(), joints.size()));
  }
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const std::string& name = metadata.joint_names[i];
    const bool known =
        std::ranges::any_of(robot.joints, [&](const config::Joint& joint) { return joint.name == name; });
    if (!known || name == joints[i]->name) continue;
    return std::unexpected(
        fmt::format("{}: the policy's joint {} is {} by its metadata, {} by policy.joint_order; mend it", robot.file, i,
                    name, joints[i]->name));
  }
  return {};
}

}  // namespace

std::expected<ExporterMetadata, std::string> read_exporter_metadata(
    const std::vector<std::pair<std::string, std::string>>& metadata) {
  ExporterMetadata read;
  NumberLists numbers;
  for (const auto& [key, value] : metadata) {
    if (key == "joint_names") read.joint_names = items_of(value);
    if (key == "observation_names") read.observation_names = items_of(value);
    if (key == "joint_stiffness") read.stiffness = numbers.read(key, value);
    if (key == "joint_damping") read.damping = numbers.read(key, value);
    if (key == "default_joint_pos") read.default_position = numbers.read(key, value);
    if (key == "action_scale") read.action_scale = numbers.read(key, value);
  }
  if (read.joint_names.empty()) return ExporterMetadata{};
  if (!numbers.problem.empty()) return std::unexpected(numbers.problem);
  for (const auto* list : {&read.stiffness, &read.damping, &read.default_position}) {
    if (list->empty() || list->size() == read.joint_names.size()) continue;
    return std::unexpected(fmt::format("metadata: a list of {} numbers for {} joints; export the policy again",
                                       list->size(), read.joint_names.size()));
  }
  read.rounded = numbers.most_decimals <= 3;
  return read;
}

std::expected<std::vector<std::string>, std::string> compare_metadata(const ExporterMetadata& metadata,
                                                                      const config::RobotConfig& robot) {
  std::vector<std::string> differences;
  if (metadata.joint_names.empty()) return differences;
  const std::vector<const config::Joint*> joints = policy_joints(robot);
  if (const auto order = check_order(metadata, robot, joints); !order) return std::unexpected(order.error());
  const auto compare = [&](std::size_t i, const char* what, const std::vector<double>& said, double has) {
    const double tolerance = metadata.rounded ? kRounding : 1e-6;
    if (said.empty() || std::abs(said[i] - has) <= tolerance) return;
    differences.push_back(fmt::format("joint {}: {} is {:g} in the robot's file, {:g} in the policy's metadata",
                                      joints[i]->name, what, has, said[i]));
  };
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (metadata.joint_names[i] != joints[i]->name) {
      differences.push_back(
          fmt::format("joint {} is called {} in the policy's metadata", joints[i]->name, metadata.joint_names[i]));
    }
    compare(i, "kp", metadata.stiffness, joints[i]->kp);
    compare(i, "kd", metadata.damping, joints[i]->kd);
    compare(i, "home", metadata.default_position, joints[i]->home);
  }
  return differences;
}

}  // namespace takt::policy_host
