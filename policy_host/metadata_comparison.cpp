// SPDX-License-Identifier: Apache-2.0
#include "policy_host/metadata_comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "config/joint_units.hpp"
#include "config/robot_text.hpp"

namespace takt::policy_host {
namespace {

using config::RobotConfig;
using Result = std::expected<void, std::string>;

constexpr double kRounding = 0.5e-3 + 1e-9;  // of three decimals
constexpr double kExact = 1e-6;

double tolerance_of(const ExporterMetadata& metadata) {
  return metadata.rounded ? kRounding : kExact;
}

// By `order`, or all of the robot's.
std::vector<const config::Joint*> joints_by(const std::vector<std::size_t>& order, const RobotConfig& robot) {
  std::vector<const config::Joint*> joints;
  for (const std::size_t joint : order) joints.push_back(&robot.joints[joint]);
  if (joints.empty()) {
    for (const config::Joint& joint : robot.joints) joints.push_back(&joint);
  }
  return joints;
}

std::vector<const config::Joint*> driven_joints(const RobotConfig& robot) {
  const config::Policy& policy = *robot.policy;
  return joints_by(policy.action.joint_of_output.empty() ? policy.joint_order : policy.action.joint_of_output, robot);
}

std::unexpected<std::string> refuse(const RobotConfig& robot, const std::string& what) {
  return std::unexpected(fmt::format("{}: {}; correct it, or export the policy again", robot.file, what));
}

// `what`: "joint", `key`: of the robot file.
Result check_order(const std::vector<std::string>& names, const std::vector<const config::Joint*>& joints,
                   const RobotConfig& robot, const char* what, const char* key) {
  const auto is_unknown = [&](const std::string& name) {
    return std::ranges::find(robot.joints, name, &config::Joint::name) == robot.joints.end();
  };
  if (const auto unknown = std::ranges::count_if(names, is_unknown); unknown != 0)
    return refuse(robot,
                  fmt::format("the policy's metadata has {} joints that this robot does not have, the first is {}",
                              unknown, *std::ranges::find_if(names, is_unknown)));
  if (names.size() != joints.size())
    return refuse(robot,
                  fmt::format("the policy's metadata has {} {}s, {} {}", names.size(), what, key, joints.size()));
  for (std::size_t i = 0; i < joints.size(); ++i)
    if (names[i] != joints[i]->name)
      return refuse(robot, fmt::format("the policy's {} {} is {} by its metadata, {} by {}", what, i, names[i],
                                       joints[i]->name, key));
  return {};
}

// Of each output; nothing: it is measured at run time.
std::optional<double> offset_of(const config::Action& action, const config::Joint& joint, std::size_t output) {
  switch (action.offset) {
    case config::OffsetKind::zero:
      return 0;
    case config::OffsetKind::home:
      return joint.home;
    case config::OffsetKind::values:
      return action.offset_values[output];
    case config::OffsetKind::measured:
      return std::nullopt;
  }
  return std::nullopt;
}

double one_or_each(const std::vector<double>& values, std::size_t i) {
  return values.size() == 1 ? values.front() : values[i];
}

Result check_action(const ExporterMetadata& metadata, const RobotConfig& robot,
                    const std::vector<const config::Joint*>& driven) {
  const config::Action& action = robot.policy->action;
  for (const auto& [key, list] :
       {std::pair{"action_scale", &metadata.action_scale}, std::pair{"action_offset", &metadata.action_offset}})
    if (list->size() > 1 && list->size() != driven.size())
      return refuse(robot, fmt::format("the policy's metadata has {} values of {}, the policy {} outputs", list->size(),
                                       key, driven.size()));
  for (std::size_t i = 0; i < driven.size(); ++i) {
    if (!metadata.action_scale.empty()) {
      const double said = one_or_each(metadata.action_scale, i), has = one_or_each(action.scale, i);
      if (std::abs(said - has) > tolerance_of(metadata))
        return refuse(robot,
                      fmt::format("the action of joint {} is scaled by {:g} by the policy's metadata, by {:g} by "
                                  "policy.action.scale",
                                  driven[i]->name, said, has));
    }
    if (!metadata.action_offset.empty()) {
      const double said = one_or_each(metadata.action_offset, i);
      const std::optional<double> has = offset_of(action, *driven[i], i);
      const std::string_view unit = config::kJointPosition.unit(driven[i]->kind);
      if (std::abs(said - has.value_or(0)) > tolerance_of(metadata))
        return refuse(robot, fmt::format("the action of joint {} is from {:g} {} by the policy's metadata, from {} by "
                                         "policy.action.offset",
                                         driven[i]->name, said, unit,
                                         has ? fmt::format("{:g} {}", *has, unit) : "what is measured"));
    }
  }
  return {};
}

// Terms are the observations one by one, where there are as many; where not, all have one history, or none is compared.
Result check_histories(const ExporterMetadata& metadata, const RobotConfig& robot,
                       std::vector<std::string>& differences) {
  const std::vector<double>& said = metadata.history_lengths;
  const auto& terms = robot.policy->observation;
  if (said.empty()) return {};
  const bool one_for_all = std::ranges::all_of(said, [&](double length) { return length == said.front(); });
  if (said.size() != terms.size() && !one_for_all) {
    differences.push_back(
        fmt::format("{} observations in the policy's metadata, {} terms in the robot's file: which "
                    "history is whose is not compared",
                    said.size(), terms.size()));
    return {};
  }
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const double length = std::max(one_for_all ? said.front() : said[i], 1.0);  // 0: none but the newest
    if (length != terms[i].history)
      return refuse(robot, fmt::format("the policy's metadata has a history of {:g} for observation {}, policy."
                                       "observation[{}] of {}",
                                       length, i, i, terms[i].history));
  }
  return {};
}

// Where the metadata has no offsets, its pose may be them.
void compare_offset_with_pose(const ExporterMetadata& metadata, const RobotConfig& robot,
                              const std::vector<const config::Joint*>& driven, std::vector<std::string>& differences) {
  const config::Action& action = robot.policy->action;
  if (action.offset == config::OffsetKind::home || !metadata.action_offset.empty()) return;
  for (std::size_t i = 0; i < driven.size(); ++i) {
    const auto place = std::ranges::find(metadata.joint_names, driven[i]->name) - metadata.joint_names.begin();
    const std::optional<double> has = offset_of(action, *driven[i], i);
    if (metadata.default_position.empty() || !has) return;
    const double said = metadata.default_position[static_cast<std::size_t>(place)];
    if (std::abs(said - *has) > tolerance_of(metadata))
      differences.push_back(
          fmt::format("joint {}: the action's offset is {:g} in the robot's file, the pose {:g} in the "
                      "policy's metadata, which has no action_offset",
                      driven[i]->name, *has, said));
  }
}

}  // namespace

std::vector<std::string> joint_differences(const DescribedJoints& said, const RobotConfig& robot, double tolerance,
                                           const std::string& where) {
  std::vector<std::string> differences;
  for (std::size_t i = 0; i < said.joints.size(); ++i) {
    const std::string name = config::joint_names_of({said.joints[i]}).front();
    const auto joint = std::ranges::find(robot.joints, name, &config::Joint::name);
    if (joint == robot.joints.end()) continue;
    const auto compare = [&](const char* what, const std::vector<double>& values, double has) {
      if (values.empty() || std::abs(values[i] - has) <= tolerance) return;
      differences.push_back(fmt::format("joint {}: {} is {:g} in the robot's file, {:g} in {}", joint->name, what, has,
                                        values[i], where));
    };
    compare("kp", said.stiffness, joint->kp);
    compare("kd", said.damping, joint->kd);
    compare("home", said.default_position, joint->home);
  }
  return differences;
}

std::expected<std::vector<std::string>, std::string> compare_metadata(const ExporterMetadata& exported,
                                                                      const RobotConfig& robot) {
  if (exported.joint_names.empty()) return {};
  ExporterMetadata metadata = exported;
  for (std::vector<std::string>* const names : {&metadata.joint_names, &metadata.action_joints})
    *names = config::joint_names_of(*names);
  const std::vector<const config::Joint*> driven = driven_joints(robot);
  if (auto fine = check_order(metadata.joint_names, joints_by(robot.policy->joint_order, robot), robot, "joint",
                              "policy.joint_order");
      !fine)
    return std::unexpected(fine.error());
  // Where it does not say which joints are moved, it is all of them, or the robot file's choice.
  const std::vector<std::string>& moved =
      metadata.action_joints.empty() ? metadata.joint_names : metadata.action_joints;
  if (!metadata.action_joints.empty() || moved.size() == driven.size()) {
    if (auto fine = check_order(moved, driven, robot, "output", "policy.action.joints"); !fine)
      return std::unexpected(fine.error());
  }
  if (auto fine = check_action(metadata, robot, driven); !fine) return std::unexpected(fine.error());
  std::vector<std::string> differences =
      joint_differences({metadata.joint_names, metadata.stiffness, metadata.damping, metadata.default_position}, robot,
                        tolerance_of(metadata), "the policy's metadata");
  if (auto fine = check_histories(metadata, robot, differences); !fine) return std::unexpected(fine.error());
  compare_offset_with_pose(metadata, robot, driven, differences);
  return differences;
}

}  // namespace takt::policy_host
