// SPDX-License-Identifier: Apache-2.0
#include "config/model_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/units.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {
namespace {

constexpr double kFullTorqueAt = 0.2;            // rad off
constexpr double kFullForceAt = 0.005;           // m off
constexpr double kSlowest = 30, kFastest = 100;  // rad/s, of a joint on its made-up spring
constexpr double kDampingTime = 0.05;            // s, of the spring

// Of a joint alone: a spring that its torque fits, and that a loop of 1 ms can hold.
double stiffness_of(const ModelJoint& joint) {
  const double low = joint.inertia * kSlowest * kSlowest, high = joint.inertia * kFastest * kFastest;
  const double full_at = joint.kind == JointKind::slide ? kFullForceAt : kFullTorqueAt;
  return joint.torque ? std::clamp(*joint.torque / full_at, low, high) : high;
}

double damping_of(const ModelJoint& joint) {
  const double stiffness = stiffness_of(joint);
  return std::max(2 * std::sqrt(stiffness * joint.inertia), kDampingTime * stiffness);
}

double rounded(double value) {
  return parse_number(fmt::format("{:.4g}", value)).value_or(value);
}

}  // namespace

std::expected<std::string, std::string> robot_of_model(ImportOptions options) {
  ModelFacts& model = *options.model;
  if (model.joints.empty()) return std::unexpected("the model has no hinge or slide that a drive could move");
  if (model.joints.size() > kMaxJoints)
    return std::unexpected(
        fmt::format("the model has {} joints, a robot file {} at most; take out those that no drive "
                    "moves",
                    model.joints.size(), kMaxJoints));
  DeployFile deploy;
  options.policy_file.clear();
  options.joint_names.clear();
  for (const ModelJoint& joint : model.joints) {
    deploy.robot_joint.push_back(deploy.slot.size());
    deploy.slot.push_back(deploy.slot.size());
    deploy.default_position.push_back(joint.home);
    options.joint_names.push_back(joint.name);
    if (!options.simulated) continue;
    deploy.stiffness.push_back(rounded(stiffness_of(joint)));
    deploy.damping.push_back(rounded(damping_of(joint)));
  }
  if (options.simulated) deploy.step_dt = milliseconds(20);
  return import_deploy_file(deploy, options);
}

}  // namespace takt::config
