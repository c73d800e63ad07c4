// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/virtual_bus.hpp"

#include <algorithm>
#include <utility>

#include "config/turns.hpp"
#include "drivers/protocol/bus_load.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kLossStream = 101;

Duration bits(double count, std::uint32_t rate) {
  return {static_cast<std::int64_t>(count * 1e9 / rate)};
}

Duration wire_time(const drivers::CanFrame& frame, const config::Bus& bus) {
  if (!frame.fd) return bits(drivers::most_frame_bits(frame.length, frame.extended), bus.bitrate);
  const drivers::FdFrameBits parts = drivers::most_fd_frame_bits(frame.length, frame.extended);
  return bits(parts.arbitration, bus.bitrate) +
         bits(parts.data, bus.data_bitrate != 0 ? bus.data_bitrate : bus.bitrate);
}

}  // namespace

std::expected<VirtualBus, std::string> VirtualBus::make(const config::RobotConfig& robot,
                                                        const Disturbance& disturbance, std::uint64_t seed,
                                                        bool guarded) {
  std::vector<std::unique_ptr<drivers::JointDriver>> drivers;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    auto driver = drivers::make_joint_driver(robot, joint);
    if (!driver) return std::unexpected(robot.file + ": " + driver.error());
    drivers.push_back(std::move(*driver));
  }
  return VirtualBus(robot, disturbance, seed, std::move(drivers), guarded);
}

VirtualBus::VirtualBus(const config::RobotConfig& robot, const Disturbance& disturbance, std::uint64_t seed,
                       std::vector<std::unique_ptr<drivers::JointDriver>> drivers, bool guarded)
    : robot_(robot),
      disturbance_(disturbance),
      losses_(seed, kLossStream),
      drivers_(std::move(drivers)),
      buses_(robot.buses.size()),
      guard_(robot),
      guarded_(guarded),
      refused_(robot.joints.size()),
      turns_(config::turns_of(robot)),
      encoded_(drivers::kMaxFramesPerDrive) {
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    buses_[robot.joints[joint].bus].joints.push_back(joint);
}

bool VirtualBus::is_off(std::size_t bus, MonoTime now) const {
  return bus == 0 && disturbance_.dose(Trouble::bus_off, now) > 0;
}

bool VirtualBus::carry(std::size_t bus, const drivers::CanFrame& frame, MonoTime now) {
  if (is_off(bus, now)) return false;
  MonoTime& free_at = buses_[bus].free_at;
  free_at = std::max(free_at, now) + wire_time(frame, robot_.buses[bus]);
  return !losses_.happens(disturbance_.dose(Trouble::can_loss, now));
}

void VirtualBus::expect_replies(std::size_t bus, MonoTime now) {
  Bus& wire = buses_[bus];
  for (const drivers::CanFrame& frame : said_) {
    if (!carry(bus, frame, now)) continue;
    const MonoTime arrives = wire.free_at + disturbance_.delay(Trouble::can_delay, now);
    wire.on_the_way.push_back({{frame, arrives}, arrives + disturbance_.delay(Trouble::estimator_delay, now)});
  }
  said_.clear();
}

void VirtualBus::decode(Bus& bus, const drivers::ReceivedFrame& received) {
  for (const std::size_t joint : bus.joints)
    if (drivers_[joint]->decode(received)) return;
  ++bus.health.foreign_frames;
}

void VirtualBus::receive(simulation::Plant& plant, MonoTime now, pipeline::TickInput& input) {
  for (std::size_t index = 0; index < buses_.size(); ++index) {
    Bus& bus = buses_[index];
    plant.collect(index, said_);
    expect_replies(index, now);
    std::erase_if(bus.on_the_way, [&](const OnTheWay& frame) {
      if (frame.readable_at > now) return false;
      decode(bus, frame.received);
      return true;
    });
    bus.health.state = is_off(index, now) ? BusState::bus_off : BusState::up;
    input.buses[index] = bus.health;
  }
  for (std::size_t joint = 0; joint < drivers_.size(); ++joint) {
    input.joints[joint] = drivers_[joint]->feedback();
    input.joints[joint].refused = std::exchange(refused_[joint], WireVerdict::allowed);
  }
}

WireVerdict VirtualBus::guard(std::size_t joint, std::size_t bus, MonoTime now, const pipeline::TickOutput& output,
                              drivers::CanFrame& frame) {
  if (!guarded_) return WireVerdict::allowed;
  return guard_.pass(joint, bus, {output.record.header.now, now, output.valid_until, output.drive_enabled[joint]},
                     output.record.joints[joint], frame);
}

void VirtualBus::send(simulation::Plant& plant, MonoTime now, const pipeline::TickOutput& output) {
  for (std::size_t index = 0; index < buses_.size(); ++index) {
    for (const std::size_t joint : buses_[index].joints) {
      if (!is_written(turns_[joint], output.record.header)) continue;
      const pipeline::JointSetpoint& wanted = output.setpoints[joint];
      const std::size_t count =
          drivers_[joint]->encode(output.drive_enabled[joint], {wanted.q, wanted.dq, wanted.kp, wanted.kd, wanted.tau},
                                  now, output.valid_until, encoded_);
      for (std::size_t i = 0; i < count; ++i) {
        const WireVerdict verdict = guard(joint, index, now, output, encoded_[i]);
        if (refused_[joint] == WireVerdict::allowed) refused_[joint] = verdict;
        if (is_off(index, now)) ++buses_[index].health.tx_dropped;
        if (!carry(index, encoded_[i], now)) continue;
        plant.receive(index, encoded_[i], said_);
        expect_replies(index, now);
      }
    }
  }
}

}  // namespace takt::evidence
