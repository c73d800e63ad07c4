#include "executive/runtime/drive_edge.hpp"

#include <algorithm>
#include <utility>

#include "drivers/bus/can_frame.hpp"

namespace takt::runtime {

DriveEdge::DriveEdge(std::vector<std::unique_ptr<drivers::CanBus>> buses, std::vector<JointOnBus> joints)
    : buses_(std::move(buses)),
      joints_(std::move(joints)),
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
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) input.joints[joint] = joints_[joint].driver->feedback();
  return total;
}

Departure DriveEdge::send(const pipeline::TickOutput& output, Clock& clock, PublishedSegments& records) noexcept {
  Departure departure;
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    for (const std::size_t joint : joints_of_bus_[bus]) {
      const MonoTime now = clock.now();
      if (!departure.at.is_set()) departure.at = now;
      const bool damped = output.drive_enabled[joint] && now > output.send_by;
      if (damped) departure.damped |= bit_of_joint(joint);
      send_joint(bus, joint, output, damped, now, clock, records);
    }
  }
  return departure;
}

void DriveEdge::send_joint(std::size_t bus, std::size_t joint, const pipeline::TickOutput& output, bool damped,
                           MonoTime now, Clock& clock, PublishedSegments& records) noexcept {
  const pipeline::JointSetpoint& wanted = damped ? output.damping[joint] : output.setpoints[joint];
  const drivers::DriveSetpoint setpoint{wanted.q, wanted.dq, wanted.kp, wanted.kd, wanted.tau};
  const MonoTime valid_until = damped ? MonoTime{} : output.valid_until;  // no command is behind the damping
  const std::size_t count =
      joints_[joint].driver->encode(output.drive_enabled[joint], setpoint, now, valid_until, encoded_);
  MonoTime stamp = now;
  for (std::size_t i = 0; i < count; ++i) {
    if (i != 0) stamp = clock.now();
    if (buses_[bus]->send(encoded_[i]) != drivers::SendResult::sent) continue;  // counted in the bus's health
    records.frame(drivers::to_record(encoded_[i], stamp, output.record.header.tick, static_cast<std::uint8_t>(bus),
                                     FrameDirection::sent));
  }
}

}  // namespace takt::runtime
