// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/limbs.hpp"

#include <bit>

namespace takt::pipeline {
namespace {

// Parents come before their children, so one pass down gathers what hangs on each joint.
JointMask hangs_on(const TickConfig& config, std::size_t joint) {
  JointMask mask = bit_of_joint(joint);
  for (std::size_t k = joint + 1; k < config.joint_count; ++k) {
    const std::int32_t parent = config.links[k].parent;
    if (parent >= 0 && (mask & bit_of_joint(static_cast<std::size_t>(parent))) != 0) mask |= bit_of_joint(k);
  }
  return mask;
}

bool is_only_child(const TickConfig& config, std::size_t joint) {
  for (std::size_t k = 0; k < config.joint_count; ++k)
    if (k != joint && config.links[k].parent == config.links[joint].parent) return false;
  return true;
}

// The joint from which the limb begins: up the tree while nothing branches off.
std::size_t begin_of_limb(const TickConfig& config, std::size_t joint) {
  while (config.links[joint].parent >= 0 && is_only_child(config, joint))
    joint = static_cast<std::size_t>(config.links[joint].parent);
  return joint;
}

JointMask union_of(const std::array<JointMask, kMaxJoints>& masks, JointMask joints) {
  JointMask all = 0;
  for (JointMask left = joints; left != 0; left &= left - 1)
    all |= masks[static_cast<std::size_t>(std::countr_zero(left))];
  return all;
}

}  // namespace

Limbs::Limbs(const TickConfig& config) {
  const bool has_tree = config.gravity_compensation, is_free = config.imu.present;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    limb_[j] = has_tree ? hangs_on(config, begin_of_limb(config, j)) : every_joint(config.joint_count);
    beyond_[j] = has_tree ? hangs_on(config, j) : is_free ? every_joint(config.joint_count) : bit_of_joint(j);
  }
}

JointMask Limbs::of(JointMask joints) const {
  return union_of(limb_, joints);
}

JointMask Limbs::beyond(JointMask joints) const {
  return union_of(beyond_, joints);
}

}  // namespace takt::pipeline
