// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/plain_loop.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "evidence/rollout/chunk_value.hpp"

namespace takt::evidence {
namespace {

using pipeline::Interpolation;
using pipeline::JointConfig;
using pipeline::JointSetpoint;
using pipeline::LoopAt;

constexpr auto kRemembered = static_cast<std::uint32_t>(kMaxRememberedObservations);

bool has(const CommandChunk& chunk, CommandField field) {
  return (chunk.header.fields & static_cast<unsigned>(field)) != 0;
}

// How fast the targets move from step to step, rad/s.
float slope_of(const CommandChunk& chunk, const ChunkPlace& place, std::size_t joint) {
  const float from = chunk.values[value_index(chunk.header, CommandField::q, place.step, joint)];
  const float to = chunk.values[value_index(chunk.header, CommandField::q, place.next, joint)];
  return (to - from) / (static_cast<float>(chunk.header.step_period.ns) * 1.0e-9F);
}

// As the side that closes the loop wants it said.
JointSetpoint for_loop(const JointSetpoint& wanted, const JointFeedback& said, const JointConfig& joint) {
  switch (joint.loop) {
    case LoopAt::drive:
      break;
    case LoopAt::drive_position:
      return {wanted.q, 0.0F, wanted.kp, wanted.kd, 0.0F};
    case LoopAt::host_torque:
      return {wanted.q, wanted.dq, 0.0F, 0.0F,
              wanted.kp * (wanted.q - said.q) + wanted.kd * (wanted.dq - said.dq) + wanted.tau};
    case LoopAt::host_velocity: {
      const float catch_up = wanted.kd > 0.0F ? wanted.kp * (wanted.q - said.q) / wanted.kd : 0.0F;
      return {wanted.q, wanted.dq + catch_up, 0.0F, 0.0F, 0.0F};
    }
  }
  if (!(joint.drive_gains.kp > 0.0F)) return wanted;
  const float kp = std::min(wanted.kp, joint.drive_gains.kp);  // more the drive cannot be told
  return {wanted.q, wanted.dq, kp, std::min(wanted.kd, joint.drive_gains.kd * kp / joint.drive_gains.kp), wanted.tau};
}

bool is_playable(const pipeline::PolicyMessage& message, std::uint32_t joints) {
  const CommandHeader& header = message.command->header;
  return header.joint_count == joints && header.step_count >= 1 && header.step_count <= kMaxChunkSteps &&
         header.step_period > Duration{} && has(*message.command, CommandField::q) &&
         message.bytes >= message.command->used_bytes();
}

Freshness freshness_at(const pipeline::CommandInUse& command, MonoTime now,
                       const pipeline::FreshnessContract& contract) {
  if (command.sequence == 0) return Freshness::missing;
  const Duration age = command.age(now);
  if (age > contract.max_age) return Freshness::stale;
  const double aging_from = static_cast<double>(contract.aging_fraction) * static_cast<double>(contract.max_age.ns);
  return static_cast<double>(age.ns) <= aging_from ? Freshness::fresh : Freshness::aging;
}

bool is_stop(OperatorRequest request) {
  return request == OperatorRequest::stop || request == OperatorRequest::press_stop ||
         request == OperatorRequest::deenergise || request == OperatorRequest::shutdown;
}

void copy_inputs(const pipeline::TickInput& input, const pipeline::TickConfig& config, TickRecordHeader& header) {
  header = {};
  header.tick = input.tick;
  header.now = input.now;
  header.lateness = input.lateness;
  header.last_duration = input.last_duration;
  header.skipped_periods = input.skipped_periods;
  header.overrun_cause = input.overrun_cause;
  header.operator_request = input.operator_request;
  header.recorded_through = input.recorded_through;
  header.torque_output = input.torque_output;
  header.imu = input.imu;
  header.imu_verdict = input.imu.sequence != 0 ? ImuVerdict::usable : ImuVerdict::absent;
  header.seats[Seat::policy].mailbox = input.messages[Seat::policy].mailbox;
  header.seats[Seat::policy].session = input.messages[Seat::policy].session;
  header.seats[Seat::policy].command_sequence_seen =
      input.messages[Seat::policy].command != nullptr ? input.messages[Seat::policy].command->header.sequence : 0;
  header.bus_count = static_cast<std::uint8_t>(config.bus_count);
  header.joint_count = config.joint_count;
  std::copy_n(input.buses, config.bus_count, header.buses);
}

}  // namespace

JointSetpoint plain_setpoint(const CommandChunk& chunk, Duration since, std::size_t joint, float gravity,
                             const JointFeedback& said, const pipeline::TickConfig& config) {
  const JointConfig& from = config.joints[joint];
  const bool held = config.interpolation == Interpolation::hold;
  const ChunkPlace place = chunk_place(chunk.header, since, held);
  const auto value = [&](CommandField field, float otherwise) {
    return has(chunk, field) ? chunk_value(chunk, field, place, joint) : otherwise;
  };
  const bool rests = !held && place.step == place.next;  // behind the last step
  const float moves = held || rests ? 0.0F : slope_of(chunk, place, joint);
  const JointSetpoint wanted{value(CommandField::q, 0.0F), rests ? 0.0F : value(CommandField::dq, moves),
                             value(CommandField::kp, from.kp), value(CommandField::kd, from.kd),
                             value(CommandField::tau_ff, 0.0F) + gravity};
  return for_loop(wanted, said, from);
}

PlainLoop::PlainLoop(const pipeline::TickConfig& config) : config_(config), gravity_(config) {}

void PlainLoop::take(const pipeline::PolicyMessage& message, TickRecordHeader& header) {
  header.seats[Seat::policy].arrival = message.mailbox;
  if (message.mailbox != Arrival::accepted || message.command == nullptr) return;
  const CommandChunk& chunk = *message.command;
  pipeline::RememberedObservation answered;
  if (!is_playable(message, config_.joint_count)) {
    header.seats[Seat::policy].arrival = Arrival::wrong_shape;
  } else if (!std::ranges::all_of(std::span(chunk.values, chunk.value_count()),
                                  [](float value) { return std::isfinite(value); })) {
    header.seats[Seat::policy].arrival = Arrival::not_finite;  // nothing that a frame could say
  } else if (memory_.recall(chunk.header.observation_id, kRemembered, answered) !=
             pipeline::ObservationMemory::Recall::known) {
    header.seats[Seat::policy].arrival = Arrival::unknown_observation;
  }
  header.seats[Seat::policy].last_refusal =
      is_refusal(header.seats[Seat::policy].arrival) ? header.seats[Seat::policy].arrival : Arrival::none;
  if (header.seats[Seat::policy].arrival != Arrival::accepted) return;
  const MonoTime outside = chunk.header.outside_sensed_at;
  command_ = {};
  command_.sequence = chunk.header.sequence;
  command_.observation_id = chunk.header.observation_id;
  command_.sensed_at = outside.is_set() ? std::min(outside, answered.oldest_sensed_at) : answered.oldest_sensed_at;
  command_.observed_at = answered.published_at;
  command_.infer_started_at = std::clamp(chunk.header.infer_started_at, answered.published_at, header.now);
  command_.infer_ended_at = std::clamp(chunk.header.infer_ended_at, command_.infer_started_at, header.now);
  command_.first_used_at = header.now;
  command_.policy_hash = chunk.header.policy_hash;
  command_.session = message.session;
  chunk_->header = chunk.header;
  std::copy_n(chunk.values, chunk.value_count(), chunk_->values);
}

bool PlainLoop::all_enabled(const pipeline::TickInput& input) const {
  return std::ranges::all_of(std::span(input.joints, config_.joint_count),
                             [](const JointFeedback& joint) { return joint.drive_state == DriveState::enabled; });
}

void PlainLoop::change_mode(const pipeline::TickInput& input, TickRecordHeader& header) {
  const auto enter = [&](Mode mode, Cause cause) {
    mode_ = mode;
    header.cause = cause;
  };
  header.previous_mode = mode_;
  const OperatorRequest request = input.operator_request;
  switch (mode_) {
    case Mode::standby:
      if (request == OperatorRequest::arm) enter(Mode::arming, Cause::operator_arm);
      break;
    case Mode::arming:
    case Mode::tracking:
      if (is_stop(request))
        enter(Mode::damped_stop, Cause::operator_stop);
      else if (mode_ == Mode::arming && all_enabled(input))
        enter(Mode::tracking, Cause::drives_enabled);
      break;
    case Mode::damped_stop:
      if (request == OperatorRequest::reset) enter(Mode::standby, Cause::operator_reset);
      break;
    case Mode::degraded:
    case Mode::fault_latched:
      break;  // never entered
  }
  header.mode = mode_;
}

void PlainLoop::set_joints(const pipeline::TickInput& input, pipeline::TickOutput& output) const {
  std::array<float, kMaxJoints> q{}, gravity{};
  for (std::size_t j = 0; j < config_.joint_count; ++j) q[j] = input.joints[j].q;
  if (config_.gravity_compensation) gravity_.torques(q, gravity);
  const Duration since = input.now - command_.begins();
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const JointConfig& joint = config_.joints[j];
    const JointFeedback& said = input.joints[j];
    JointSetpoint& setpoint = output.setpoints[j];
    setpoint = {said.q, 0.0F, 0.0F, 0.0F, 0.0F};
    if (mode_ == Mode::tracking && !joint.passive)
      setpoint = plain_setpoint(*chunk_, since, j, gravity[j], said, config_);
    else if (mode_ != Mode::standby && !joint.passive)
      setpoint.kd = joint.damping;
    output.damping[j] = setpoint;
    output.drive_enabled[j] = output.drives_enabled;
    JointRecord& record = output.record.joints[j];
    record = {.feedback = said,
              .q_estimate = said.q,
              .dq_estimate = said.dq,
              .q_reference = setpoint.q,
              .dq_reference = setpoint.dq,
              .tau_gravity = gravity[j],
              .tau_total = setpoint.kp * (setpoint.q - said.q) + setpoint.kd * (setpoint.dq - said.dq) + setpoint.tau,
              .q_command = setpoint.q,
              .dq_command = setpoint.dq,
              .kp_command = setpoint.kp,
              .kd_command = setpoint.kd,
              .tau_command = setpoint.tau,
              .drive_enabled = static_cast<std::uint8_t>(output.drives_enabled ? 1 : 0)};
  }
}

// As the executive publishes: in the tick in which a period begins, once every joint and the IMU were heard.
void PlainLoop::publish(const pipeline::TickInput& input, pipeline::TickOutput& output) {
  output.observation_due = false;
  const std::uint64_t every = std::max<std::uint32_t>(config_.observation_every_ticks, 1);
  if (input.tick / every < next_observation_) return;
  MonoTime oldest = input.now;
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    if (!input.joints[j].received_at.is_set()) return;
    oldest = std::min(oldest, input.joints[j].received_at);
  }
  if (config_.imu.present) {
    if (input.imu.sequence == 0) return;
    oldest = std::min(oldest, input.imu.sensed_at);
  }
  next_observation_ = input.tick / every + 1;
  Observation& observation = output.observation;
  observation = {};
  observation.id = memory_.remember({oldest, input.now}, kRemembered);
  output.record.header.observation_published = observation.id;
  observation.tick = input.tick;
  observation.oldest_sensed_at = oldest;
  observation.published_at = input.now;
  observation.period = config_.period * static_cast<std::int64_t>(every);
  observation.joint_count = config_.joint_count;
  observation.mode = static_cast<std::uint8_t>(mode_);
  observation.command_sequence = command_.sequence;
  observation.imu = input.imu;
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const JointFeedback& said = input.joints[j];
    observation.q[j] = said.q;
    observation.dq[j] = observation.dq_of_drive[j] = said.dq;
    observation.tau[j] = said.tau;
    observation.q_setpoint[j] = output.setpoints[j].q;
  }
  output.observation_due = true;
}

void PlainLoop::tick(const pipeline::TickInput& input, pipeline::TickOutput& output) {
  TickRecordHeader& header = output.record.header;
  copy_inputs(input, config_, header);
  take(input.messages[Seat::policy], header);
  change_mode(input, header);
  header.seats[Seat::policy].freshness = freshness_at(command_, input.now, config_.freshness);
  if (header.seats[Seat::policy].freshness != Freshness::missing) header.age = command_.age_parts(input.now);
  header.seats[Seat::policy].command_sequence = command_.sequence;
  header.command_policy = command_.policy_hash;
  header.seats[Seat::policy].observation_answered = command_.observation_id;
  if (mode_ == Mode::tracking) {
    header.player = Player::policy;
    header.chunk_step = static_cast<std::uint8_t>(
        chunk_place(chunk_->header, input.now - command_.begins(), config_.interpolation == Interpolation::hold).step);
  }
  output.drives_enabled = mode_ != Mode::standby;
  header.drives_enabled = output.drives_enabled ? 1 : 0;
  output.torque_permitted = output.drives_enabled && config_.has_torque_output;
  header.torque_permitted = output.torque_permitted ? 1 : 0;
  output.valid_until = {};
  output.send_by = input.now + config_.period;
  set_joints(input, output);
  publish(input, output);
}

}  // namespace takt::evidence
