#include "executive/runtime/tick_follower.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace takt::runtime {

TickFollower::TickFollower(ipc::SlotReader ticks, float rest_velocity, JointMask passive, OnTransition on_transition)
    : ticks_(ticks), rest_velocity_(rest_velocity), passive_(passive), on_transition_(std::move(on_transition)) {}

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
  if (tick.mode != tick.previous_mode) on_transition_(latest_);
  last_read_.at(static_cast<std::size_t>(tick.operator_request)) = tick.tick;
  const std::span joints(latest_.joints, std::min<std::size_t>(tick.joint_count, kMaxJoints));
  // A drive given up by a latched fault is not asked: its last velocity may be all that it left behind.
  const bool slow = std::ranges::all_of(joints, [&](const JointRecord& joint) {
    const bool given_up = tick.drives_enabled != 0 && joint.drive_enabled == 0;
    const bool passive = (passive_ & bit_of_joint(static_cast<std::size_t>(&joint - joints.data()))) != 0;
    return given_up || passive || std::abs(joint.dq_estimate) < rest_velocity_;
  });
  if (!slow) {
    slow_since_ = {};
  } else if (!slow_since_.is_set()) {
    slow_since_ = tick.now;
  }
}

bool TickFollower::noticed(OperatorRequest request, std::uint64_t after_tick) const {
  return last_read(request) > after_tick;
}

bool TickFollower::rests() const {
  return slow_since_.is_set() && latest_.header.now - slow_since_ >= kRestFor;
}

}  // namespace takt::runtime
