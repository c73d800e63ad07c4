// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/tick_follower.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace takt::runtime {

TickFollower::TickFollower(ipc::SlotReader ticks, const pipeline::TickConfig& config, OnTransition on_transition)
    : ticks_(ticks), config_(config), on_transition_(std::move(on_transition)), buses_(config) {}

void TickFollower::catch_up() {
  while (true) {
    const ipc::ReadResult result = ticks_.read_next(std::as_writable_bytes(std::span(&latest_, 1)));
    lost_ += result.lost;
    if (result.status != ipc::ReadStatus::fresh) return;
    follow();
  }
}

void TickFollower::follow() {
  const TickRecordHeader& tick = latest_.header;
  if (incidents_ != nullptr) incidents_->tick(latest_);
  buses_.take(tick);
  if (queues_ != nullptr) queues_->take(tick);
  if (tick.mode != tick.previous_mode) on_transition_(latest_);
  if (tick.candidate.change != PolicyChange::none && on_policy_change_) on_policy_change_(latest_);
  follow_places();
  last_read_.at(static_cast<std::size_t>(tick.operator_request)) = tick.tick;
  const std::span joints(latest_.joints, std::min<std::size_t>(tick.joint_count, kMaxJoints));
  rest_.follow(tick.now, joints, asked_for_rest(),
               [this](std::size_t joint) { return pipeline::rest_velocity_of(config_, joint); });
}

void TickFollower::follow_places() {
  const JointMask before = std::exchange(moved_unheard_, 0);
  for (std::size_t j = 0; j < std::min<std::size_t>(latest_.header.joint_count, kMaxJoints); ++j) {
    if ((latest_.joints[j].reply_faults & bit(ReplyFault::moved_unheard)) == 0) continue;
    moved_unheard_ |= bit_of_joint(j);
    if ((before & bit_of_joint(j)) == 0 && on_moved_unheard_) on_moved_unheard_(latest_, j);
  }
}

// A drive given up by a latched fault is not asked: its last velocity may be all that it left behind.
JointMask TickFollower::asked_for_rest() const {
  JointMask asked = 0;
  for (std::size_t j = 0; j < std::min<std::size_t>(latest_.header.joint_count, kMaxJoints); ++j) {
    const bool given_up = latest_.header.drives_enabled != 0 && latest_.joints[j].drive_enabled == 0;
    if (!given_up) asked |= bit_of_joint(j);
  }
  return asked & ~pipeline::passive_joints(config_);
}

bool TickFollower::noticed(OperatorRequest request, std::uint64_t after_tick) const {
  return last_read(request) > after_tick;
}

bool TickFollower::rests() const {
  return rest_.rests(latest_.header.now);
}

}  // namespace takt::runtime
