// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/operator.hpp"

#include <algorithm>
#include <array>

#include "executive/pipeline/control_tick.hpp"

namespace takt::evidence {
namespace {

// The stop itself is always one of them.
bool only_the_stop_blocks(const TickRecord& latest, const pipeline::TickConfig& config) {
  std::array<pipeline::ArmingBlocker, 2> blockers;
  return pipeline::arming_blockers(latest, config, blockers) == 1;
}

bool nothing_blocks(const TickRecord& latest, const pipeline::TickConfig& config) {
  std::array<pipeline::ArmingBlocker, 1> blockers;
  return pipeline::arming_blockers(latest, config, blockers) == 0;
}

bool any_reads_elsewhere(const TickRecord& latest) {
  return std::any_of(latest.joints, latest.joints + latest.header.joint_count, [](const JointRecord& joint) {
    return (joint.reply_faults & bit(ReplyFault::moved_unheard)) != 0;
  });
}

}  // namespace

bool Operator::may_end_stop(MonoTime now) const {
  return rearm_after_ && stopped_at_.is_set() && now - stopped_at_ >= *rearm_after_;
}

OperatorRequest Operator::next(const TickRecord& latest, const pipeline::TickConfig& config) {
  const MonoTime now = latest.header.now;
  const Mode mode = latest.header.mode;
  switch (mode) {
    case Mode::standby:
      if (rearm_after_ && any_reads_elsewhere(latest)) return OperatorRequest::reset;
      return nothing_blocks(latest, config) ? OperatorRequest::arm : OperatorRequest::none;
    case Mode::arming:
    case Mode::tracking:
    case Mode::degraded:
      stopped_at_ = {};
      return OperatorRequest::none;
    case Mode::damped_stop:
    case Mode::fault_latched:
      if (!stopped_at_.is_set()) stopped_at_ = now;
      if (!may_end_stop(now)) return OperatorRequest::none;
      return mode == Mode::fault_latched || only_the_stop_blocks(latest, config) ? OperatorRequest::reset
                                                                                 : OperatorRequest::none;
  }
  return OperatorRequest::none;
}

}  // namespace takt::evidence
