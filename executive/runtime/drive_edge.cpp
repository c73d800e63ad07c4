// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/drive_edge.hpp"

#include <algorithm>
#include <utility>

#include "drivers/bus/can_frame.hpp"

namespace takt::runtime {
namespace {

// The record as it would be, had the tick decided this.
JointRecord told(JointRecord record, const pipeline::JointSetpoint& setpoint) noexcept {
  record.q_command = setpoint.q;
  record.dq_command = setpoint.dq;
  record.kp_command = setpoint.kp;
  record.kd_command = setpoint.kd;
  record.tau_command = setpoint.tau;
  return record;
}

}  // namespace

DriveEdge::DriveEdge(std::vector<std::unique_ptr<drivers::CanBus>> buses, std::vector<JointOnBus> joints,
                     std::unique_ptr<drivers::FrameGuard> guard, std::unique_ptr<drivers::TorqueOutput> torque)
    : buses_(std::move(buses)),
      joints_(std::move(joints)),
      guard_(std::move(guard)),
      torque_(std::move(torque)),
      refused_(joints_.size()),
      joints_of_bus_(buses_.size()),
      foreign_frames_(buses_.size()),
      received_(kMaxFramesPerBus),
      encoded_(drivers::kMaxFramesPerDrive) {
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) joints_of_bus_.at(joints_[joint].bus).push_back(joint);
}

void DriveEdge::offer(std::size_t bus, const drivers::ReceivedFrame& received) noexcept {
  for (const std::size_t joint : joints_of_bus_[bus]) {
    if (joints_[joint].driver->decode(received)) return;
  }
  ++foreign_frames_[bus];
}

bool DriveEdge::is_flood(std::size_t bus, std::size_t frames) const noexcept {
  return frames > std::min(joints_of_bus_[bus].size() * drivers::kMaxFramesPerDrive, kMaxFramesPerBus - 1);
}

std::size_t DriveEdge::receive(pipeline::TickInput& input, PublishedSegments& records) noexcept {
  std::size_t total = 0;
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    const std::size_t count = buses_[bus]->receive(received_);
    total += count;
    for (std::size_t i = 0; i < count; ++i) {
      const drivers::ReceivedFrame& received = received_[i];
      offer(bus, received);
      records.frame(drivers::to_record(received.frame, received.received_at, input.tick, static_cast<std::uint8_t>(bus),
                                       FrameDirection::received));
    }
    input.buses[bus] = buses_[bus]->health();
    input.buses[bus].foreign_frames += foreign_frames_[bus];
    input.buses[bus].flooded = is_flood(bus, count) ? 1 : 0;
  }
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    input.joints[joint] = joints_[joint].driver->feedback();
    input.joints[joint].refused = std::exchange(refused_[joint], WireVerdict::allowed);
  }
  return total;
}

Departure DriveEdge::send(const pipeline::TickOutput& output, Clock& clock, const SuspendWatch& suspend,
                          PublishedSegments& records) noexcept {
  Departure departure;
  if (torque_)
    departure.torque_output =
        torque_->tell(output.torque_permitted) ? TorqueOutputState::as_told : TorqueOutputState::failed;
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    for (const std::size_t joint : joints_of_bus_[bus]) {
      if (!is_written(joints_[joint].turns, output.record.header)) continue;
      const MonoTime now = clock.now();
      if (!departure.at.is_set()) departure.at = now;
      const bool damped = output.drive_enabled[joint] && now > output.send_by;
      if (damped) departure.damped |= bit_of_joint(joint);
      send_joint(joint, output, damped, now, clock, suspend, records);
    }
  }
  return departure;
}

void DriveEdge::send_joint(std::size_t joint, const pipeline::TickOutput& output, bool damped, MonoTime now,
                           Clock& clock, const SuspendWatch& suspend, PublishedSegments& records) noexcept {
  const pipeline::JointSetpoint& wanted = damped ? output.damping[joint] : output.setpoints[joint];
  const drivers::DriveSetpoint setpoint{wanted.q, wanted.dq, wanted.kp, wanted.kd, wanted.tau};
  const TickRecordHeader& header = output.record.header;
  const JointRecord& recorded = output.record.joints[joint];
  const JointRecord decided = damped ? told(recorded, wanted) : recorded;
  const MonoTime valid_until = damped ? MonoTime{} : output.valid_until;  // no command is behind the damping
  drivers::JointDriver& driver = *joints_[joint].driver;
  drivers::GuardedMoment moment{header.now, now, valid_until, output.drive_enabled[joint]};
  const std::size_t count = driver.encode(moment.enabled, setpoint, now, valid_until, encoded_);
  moment.shift = driver.shift();
  for (std::size_t i = 0; i < count; ++i) {
    const Duration since_boot = clock.since_boot();
    moment.now = clock.now();
    if (suspend.has_slept(since_boot, moment.now)) return;
    send_guarded(joint, moment, decided, encoded_[i], header.tick, records);
  }
}

void DriveEdge::send_guarded(std::size_t joint, const drivers::GuardedMoment& moment, const JointRecord& decided,
                             drivers::CanFrame& frame, std::uint64_t tick, PublishedSegments& records) noexcept {
  const std::size_t bus = joints_[joint].bus;
  const auto log = [&](const drivers::CanFrame& one, FrameDirection direction) {
    records.frame(drivers::to_record(one, moment.now, tick, static_cast<std::uint8_t>(bus), direction));
  };
  const drivers::CanFrame asked = frame;
  const WireVerdict verdict = guard_->pass(joint, bus, moment, decided, frame);
  if (verdict != WireVerdict::allowed) {
    log(asked, FrameDirection::refused);
    if (refused_[joint] == WireVerdict::allowed) refused_[joint] = verdict;
  }
  // A frame that the bus does not take is counted in its health.
  if (buses_[bus]->send(frame) == drivers::SendResult::sent) log(frame, FrameDirection::sent);
}

}  // namespace takt::runtime
