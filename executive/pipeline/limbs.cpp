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

}  // namespace

Limbs::Limbs(const TickConfig& config) {
  for (std::size_t j = 0; j < config.joint_count; ++j)
    limb_[j] =
        config.gravity_compensation ? hangs_on(config, begin_of_limb(config, j)) : every_joint(config.joint_count);
}

JointMask Limbs::of(JointMask joints) const {
  JointMask all = 0;
  for (JointMask left = joints; left != 0; left &= left - 1)
    all |= limb_[static_cast<std::size_t>(std::countr_zero(left))];
  return all;
}

}  // namespace takt::pipeline
