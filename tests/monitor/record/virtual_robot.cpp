// SPDX-License-Identifier: Apache-2.0
#include "tests/monitor/record/virtual_robot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>

#include "config/load.hpp"
#include "executive/ipc/crc32c.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "monitor/record/bytes.hpp"

namespace takt::monitor {
namespace {

constexpr std::int64_t kStart = 1'000'000'000'000;  // ns: some 17 minutes after boot

std::byte* zeroed(std::size_t bytes) {
  void* memory = std::aligned_alloc(4096, (bytes + 4095) / 4096 * 4096);
  if (memory == nullptr) throw std::bad_alloc();
  std::memset(memory, 0, bytes);
  return static_cast<std::byte*>(memory);
}

}  // namespace

const config::RobotConfig& demo_robot() {
  static const config::RobotConfig robot = [] {
    auto loaded = config::load("config/arm6.yaml");
    if (!loaded) throw std::runtime_error(loaded.error());
    return *loaded;
  }();
  return robot;
}

VirtualRobot::RingMemory::RingMemory(const ipc::RingShape& shape)
    : size(ipc::ring_bytes(shape)), data(zeroed(size), &std::free), writer({data.get(), size}, shape) {}

VirtualRobot::VirtualRobot(const config::RobotConfig& robot)
    : config_(setup::tick_config_of(robot, kPolicyHash)),
      state_(pipeline::make_tick_state(config_)),
      ticks_(ipc::tick_ring(config_.joint_count)),
      commands_(ipc::command_ring()),
      keyframes_(ipc::keyframe_ring()),
      frames_(ipc::frame_ring()) {
  for (std::size_t joint = 0; joint < config_.joint_count; ++joint) {
    input_->joints[joint].q = config_.joints[joint].home;
    input_->joints[joint].drive_state = DriveState::disabled;
  }
}

RingMemories VirtualRobot::rings() const {
  const auto view = [](const RingMemory& ring) { return std::span<const std::byte>(ring.data.get(), ring.size); };
  return {view(ticks_), view(commands_), view(keyframes_), view(frames_)};
}

RunManifest VirtualRobot::manifest() const {
  RunManifest manifest;
  manifest.run_id = "virtual";
  manifest.robot = demo_robot().robot;
  for (const config::Joint& joint : demo_robot().joints) manifest.joints.push_back(joint.name);
  for (const config::Bus& bus : demo_robot().buses) manifest.buses.push_back(bus.interface);
  manifest.watchdog_waivers = {{"elbow", "seen to stop"}};
  manifest.config_sha256 = demo_robot().sha256;
  manifest.executive = {{"realtime", false}, {"policy_hash", "1122334455667788"}};
  manifest.host = host_facts();
  manifest.clock = {1'700'000'000'000'000'000, "monitor"};
  manifest.started_at = {kStart};
  return manifest;
}

// Drives follow their position setpoints, and are enabled when told so.
void VirtualRobot::sense() {
  for (std::size_t joint = 0; joint < config_.joint_count; ++joint) {
    JointFeedback& feedback = input_->joints[joint];
    feedback.received_at = input_->now - microseconds(300 + static_cast<std::int64_t>(joint));
    ++feedback.replies;
    feedback.drive_state = output_->drives_enabled ? DriveState::enabled : DriveState::disabled;
    const float step = output_->setpoints[joint].kp > 0 ? 0.02F * (output_->setpoints[joint].q - feedback.q) : 0.0F;
    feedback.q += step;
    feedback.dq = step * 1000.0F;
  }
}

void VirtualRobot::answer(const Observation& observation) {
  auto chunk = std::make_unique<CommandChunk>();
  CommandHeader& header = chunk->header;
  header.observation_id = observation.id;
  header.sequence = ++sequence_;
  header.policy_hash = kPolicyHash;
  header.outside_sensed_at = observation.published_at - milliseconds(25);
  header.dequeued_at = observation.published_at + milliseconds(1);
  header.infer_started_at = observation.published_at + milliseconds(2);
  header.infer_ended_at = observation.published_at + milliseconds(9);
  header.published_at = observation.published_at + milliseconds(10);
  header.step_period = milliseconds(10);
  header.step_count = 16;
  header.joint_count = static_cast<std::uint16_t>(config_.joint_count);
  header.fields = static_cast<std::uint8_t>(CommandField::q);
  for (std::size_t step = 0; step < header.step_count; ++step) {
    for (std::size_t joint = 0; joint < config_.joint_count; ++joint) {
      const double phase = static_cast<double>(observation.tick + 10 * step) * 0.002;
      chunk->values[value_index(header, CommandField::q, step, joint)] =
          config_.joints[joint].home + 0.2F * static_cast<float>(std::sin(phase));
    }
  }
  if (spoil_answer) spoil_answer(*chunk);
  answers_.push_back({observation.tick + answer_ticks, std::move(chunk)});
}

void VirtualRobot::publish() {
  ticks_.writer.publish(bytes_of(output_->record).first(output_->record.used_bytes()));
  const TickTag tag{input_->tick};
  if (input_->messages[Seat::policy].command != nullptr) {
    const auto message = bytes_of(*command_).first(input_->messages[Seat::policy].bytes);
    CommandTag command{input_->tick, static_cast<std::uint32_t>(message.size()), 0};
    const bool is_cut = cuts_what_is_refused && output_->record.header.seats[Seat::policy].arrival != Arrival::accepted;
    if (is_cut) command.crc = ipc::crc32c(message);
    commands_.writer.publish(bytes_of(command), is_cut ? message.first(sizeof(CommandHeader)) : message);
  }
  if (input_->tick % kKeyframeEvery == 0) {
    Bytes state(ipc::kMaxKeyframeBytes - sizeof tag);
    const std::size_t size = pipeline::save(*state_, state);
    keyframes_.writer.publish(bytes_of(tag), std::span<const std::byte>(state).first(size));
  }
  const FrameRecord frame{input_->now, input_->tick, 0x123, 0, FrameDirection::sent, 2, 0, {0xAB, 0xCD}};
  frames_.writer.publish(bytes_of(frame));
}

void VirtualRobot::step() {
  ++input_->tick;
  input_->recorded_through = input_->tick;  // nothing here is lost
  input_->now = MonoTime{kStart} + config_.period * static_cast<std::int64_t>(input_->tick);
  input_->lateness = microseconds(static_cast<std::int64_t>(input_->tick % 40));
  input_->last_duration = microseconds(8);
  sense();
  input_->operator_request = input_->tick == arm_at ? OperatorRequest::arm : OperatorRequest::none;
  if (mark_at != 0 && input_->tick == mark_at) input_->operator_request = OperatorRequest::mark;
  if (spoil_input) spoil_input(*input_);
  input_->messages[Seat::policy].mailbox = Arrival::none;
  input_->messages[Seat::policy].command = nullptr;
  input_->messages[Seat::policy].bytes = 0;
  if (!answers_.empty() && answers_.front().due <= input_->tick) {
    command_ = std::move(answers_.front().chunk);
    answers_.erase(answers_.begin());
    input_->messages[Seat::policy].mailbox = Arrival::accepted;
    input_->messages[Seat::policy].command = command_.get();
    input_->messages[Seat::policy].bytes = command_->used_bytes();
  }
  pipeline::control_tick(*state_, *input_, config_, *output_);
  if (output_->observation_due && !policy_is_frozen) answer(output_->observation);
  publish();
}

void VirtualRobot::run(std::uint64_t ticks) {
  for (std::uint64_t tick = 0; tick < ticks; ++tick) step();
}

}  // namespace takt::monitor
