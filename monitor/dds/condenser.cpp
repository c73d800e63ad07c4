// SPDX-License-Identifier: Apache-2.0
#include "monitor/dds/condenser.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace takt::monitor::dds {

Condenser::Condenser(const config::RobotConfig& robot, std::int64_t monotonic_to_unix_ns, MonoTime since, Outbox& out)
    : robot_(robot),
      out_(out),
      monotonic_to_unix_ns_(monotonic_to_unix_ns),
      since_(since),
      diagnoser_(robot),
      joint_state_rate_({std::llround(1e9 / robot.dds->joint_state_rate)}) {}

void Condenser::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (header.now < since_ || header.joint_count != robot_.joints.size()) return;
  auto diagnostics = diagnoser_.tick(record);
  if (is_first_use(header))
    out_.put(CommandAge{unix_ns(header.now), header.tick, header.seats[Seat::policy].command_sequence,
                        header.seats[Seat::policy].observation_answered, header.age});
  if (joint_state_rate_.is_due(header.now)) put_joint_states(record);
  const bool changed = header.mode != header.previous_mode;
  const bool status_due = status_rate_.is_due(header.now);
  if (changed || status_due) out_.put(status(true));
  if (diagnostics) out_.put(Diagnostics{unix_ns(header.now), std::move(*diagnostics)});
}

Status Condenser::status(bool running) const {
  return {{diagnoser_.status()}, unix_ns(diagnoser_.status().tick.now), running};
}

void Condenser::put_joint_states(const TickRecord& record) {
  const std::span joints(record.joints, record.header.joint_count);
  JointStates message;
  MonoTime oldest = record.header.now, newest;
  for (const JointRecord& joint : joints) {
    oldest = std::min(oldest, joint.feedback.received_at);
    newest = std::max(newest, joint.feedback.received_at);
    message.position.push_back(joint.feedback.q);
    message.velocity.push_back(joint.dq_estimate);
    message.effort.push_back(joint.feedback.tau);
  }
  if (!oldest.is_set() || newest <= newest_heard_) return;
  newest_heard_ = newest;
  message.unix_ns = unix_ns(oldest);
  out_.put(std::move(message));
}

void Condenser::end() {
  const Status last = status(false);
  out_.put(last);
  out_.put(Diagnostics{last.unix_ns, diagnose_absence(robot_)});
}

}  // namespace takt::monitor::dds
