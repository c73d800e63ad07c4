#include "monitor/dds/condenser.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "drivers/cause_detail.hpp"
#include "monitor/dds/diagnostics.hpp"

namespace takt::monitor::dds {

Condenser::Condenser(const config::RobotConfig& robot, std::int64_t monotonic_to_unix_ns, MonoTime since, Outbox& out)
    : robot_(robot),
      out_(out),
      monotonic_to_unix_ns_(monotonic_to_unix_ns),
      since_(since),
      joint_state_period_{std::llround(1e9 / robot.dds->joint_state_rate)} {}

bool Condenser::is_due(MonoTime& next, MonoTime now, Duration period) {
  if (now < next) return false;
  next = now < next + period ? next + period : now + period;
  return true;
}

void Condenser::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (header.now < since_ || header.joint_count != robot_.joints.size()) return;
  const bool changed = header.mode != header.previous_mode;
  if (changed) {
    status_.cause = header.cause;
    status_.detail = drivers::cause_detail(header.cause, record, robot_);
  }
  if (header.overrun_cause != OverrunCause::none) ++status_.overruns;
  status_.tick = header;
  status_.unix_ns = unix_ns(header.now);

  if (header.arrival == Arrival::accepted && header.freshness != Freshness::missing)
    out_.put(
        CommandAge{unix_ns(header.now), header.tick, header.command_sequence, header.observation_answered, header.age});
  if (is_due(next_joint_states_, header.now, joint_state_period_)) put_joint_states(record);
  const bool status_due = is_due(next_status_, header.now, kStatusPeriod);
  if (changed || status_due) out_.put(status_);
  const bool diagnostics_due = is_due(next_diagnostics_, header.now, kDiagnosticsPeriod);
  if (changed || diagnostics_due) out_.put(Diagnostics{unix_ns(header.now), diagnose(record, status_, robot_)});
}

void Condenser::put_joint_states(const TickRecord& record) {
  const std::span joints(record.joints, record.header.joint_count);
  JointStates message;
  MonoTime oldest = record.header.now;
  for (const JointRecord& joint : joints) {
    oldest = std::min(oldest, joint.feedback.received_at);
    message.position.push_back(joint.feedback.q);
    message.velocity.push_back(joint.dq_estimate);
    message.effort.push_back(joint.feedback.tau);
  }
  message.unix_ns = unix_ns(oldest);
  if (!oldest.is_set() || message.unix_ns <= joint_states_unix_ns_) return;
  joint_states_unix_ns_ = message.unix_ns;
  out_.put(std::move(message));
}

void Condenser::end() {
  status_.running = false;
  out_.put(status_);
  out_.put(Diagnostics{status_.unix_ns, diagnose_absence(robot_)});
}

}  // namespace takt::monitor::dds
