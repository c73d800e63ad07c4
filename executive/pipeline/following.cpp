// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/following.hpp"

#include <algorithm>
#include <cmath>

namespace takt::pipeline {

float following_share(const JointState& joint, float q, const JointConfig& config) {
  const float kp = joint.kp_before;
  if (!(kp > 0.0F) || config.passive) return 0.0F;
  const float apart = std::abs(static_cast<float>(joint.reference.q - static_cast<double>(q)));
  if (config.following_error > 0.0F) return apart / config.following_error;
  if (config.loop == LoopAt::host_velocity) return 0.0F;
  return apart * kp / (kFollowingShare * config.limits.torque);
}

void watch_following(TickState& state, const TickConfig& config, TickRecord& record) {
  const MonoTime now = record.header.now;
  const Duration timeout = config.following.timeout;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointState& joint = state.joints[j];
    if (!(following_share(joint, record.joints[j].q_estimate, config.joints[j]) > 1.0F))
      joint.behind_since = {};
    else if (!joint.behind_since.is_set())
      joint.behind_since = now;
    const MonoTime since = joint.behind_since;
    record.joints[j].behind = since.is_set() && timeout > Duration{} && now - since >= timeout ? 1 : 0;
  }
}

CauseMask following_conditions(const TickRecord& record, const TickConfig& config) {
  const bool is_any = std::any_of(record.joints, record.joints + config.joint_count,
                                  [](const JointRecord& joint) { return joint.behind != 0; });
  const bool stops = config.following.then == FollowingReaction::stop;
  return is_any ? bit(Cause::following_error) | (stops ? bit(Cause::following_lost) : 0) : 0;
}

}  // namespace takt::pipeline
