// SPDX-License-Identifier: Apache-2.0
#include "tests/executive/pipeline/rig.hpp"

#include <algorithm>

namespace takt::pipeline::testing {
namespace {

constexpr int kEnableDelayTicks = 3;
constexpr float kTrueInertiaFactor = 1.5F;  // the configured inertia is a lower bound
constexpr float kFriction = 0.1F;           // Nm s/rad
constexpr float kHandStiffness = 1500.0F;   // Nm/rad
constexpr float kHandDamping = 20.0F;       // Nm s/rad

}  // namespace

TickConfig robot(std::uint32_t joints) {
  TickConfig config;
  config.period = milliseconds(1);
  config.joint_count = joints;
  config.bus_count = 1;
  config.observation_every_ticks = 20;
  config.freshness = {.max_age = milliseconds(100),
                      .aging_fraction = 0.8F,
                      .epsilon = 0.01,
                      .window_ticks = 1000,
                      .recover_after = milliseconds(200),
                      .flap_memory = seconds(10),
                      .stop_after = milliseconds(500),
                      .degrade_after = {},
                      .bad_command_limit = 20};
  config.feedback_timeout = milliseconds(20);
  config.enable_timeout = milliseconds(300);
  config.late_share = 0.02;
  for (std::uint32_t j = 0; j < joints; ++j) {
    const float k = 1.0F + 0.05F * static_cast<float>(j % 7);
    config.joints[j] = {.limits = {.q_min = -1.5F * k,
                                   .q_max = 1.4F * k,
                                   .velocity = 3.0F * k,
                                   .acceleration = 15.0F * k,
                                   .torque = 30.0F * k,
                                   .torque_rate = 3000.0F * k,
                                   .kp_max = 200.0F,
                                   .kd_max = 6.0F,
                                   .q_hard_margin = 0.15F,
                                   .velocity_hard = 8.0F * k,
                                   .target_margin = 0.15F},
                        .kp = 120.0F,
                        .kd = 4.0F,
                        .damping = 4.0F,
                        .inertia = 0.1F * k,
                        .fallback_pose = 0.2F,
                        .fallback_speed = 0.3F,
                        .observer_bandwidth = 200.0F};
    config.links[j].parent = static_cast<std::int32_t>(j) - 1;
    config.links[j].origin_xyz = {0.05F, 0.0F, 0.1F};
    config.links[j].axis = j % 2 == 0 ? std::array<float, 3>{0, 1, 0} : std::array<float, 3>{0, 0, 1};
    config.links[j].mass = 0.4F;
    config.links[j].com = {0.02F, 0.01F, 0.05F};
  }
  return config;
}

CommandChunk chunk_for(const TickConfig& config, std::uint64_t observation, MonoTime observed_at, MonoTime now,
                       std::uint64_t sequence, float q_target, std::uint16_t steps) {
  CommandChunk chunk;
  CommandHeader& header = chunk.header;
  header.observation_id = observation;
  header.sequence = sequence;
  header.policy_hash = config.policy.hash;
  header.dequeued_at = header.infer_started_at = observed_at;
  header.infer_ended_at = header.published_at = now;
  header.step_period = milliseconds(10);
  header.step_count = steps;
  header.joint_count = static_cast<std::uint16_t>(config.joint_count);
  header.fields = static_cast<std::uint8_t>(CommandField::q);
  std::fill_n(chunk.values, chunk.value_count(), q_target);
  return chunk;
}

Rig::Rig(const TickConfig& robot_config, MonoTime start)
    : config(robot_config), state(make_tick_state(robot_config)), now(start), gravity_(robot_config) {}

void Rig::sense() {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const Drive& drive = drives[j];
    if (drive.silent || !drive.asked) continue;
    JointFeedback& feedback = input.joints[j];
    feedback.received_at = now - microseconds(300);
    ++feedback.replies;
    feedback.q = drive.q;
    feedback.dq = drive.dq;
    feedback.tau = drive.tau;
    const bool enabled = drive.enabling_ticks >= kEnableDelayTicks && !drive.drops_out && !drive.never_enables;
    feedback.drive_state = drive.fault ? DriveState::fault : enabled ? DriveState::enabled : DriveState::disabled;
    feedback.error_code = drive.fault ? 9 : 0;
  }
}

void Rig::move() {
  std::array<float, kMaxJoints> q{}, gravity{};
  for (std::size_t j = 0; j < config.joint_count; ++j) q[j] = drives[j].q;
  if (config.gravity_compensation) gravity_.torques(q, gravity);
  input.last_sent_at = now;
  input.last_damped = 0;
  const float dt = 0.001F;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    Drive& drive = drives[j];
    const bool damped = out->drive_enabled[j] && (late & bit_of_joint(j)) != 0;
    if (damped) input.last_damped |= bit_of_joint(j);
    drive.asked = is_written(config.joints[j].turns, out->record.header);
    if (drive.asked) {
      drive.told = damped ? out->damping[j] : out->setpoints[j];
      drive.told_enabled = out->drive_enabled[j];
    }
    const JointSetpoint& setpoint = drive.told;
    drive.enabling_ticks = drive.told_enabled ? drive.enabling_ticks + 1 : 0;
    const bool powered = drive.enabling_ticks >= kEnableDelayTicks && !drive.fault && !drive.drops_out;
    const float limit = config.joints[j].limits.torque;
    const float torque = setpoint.kp * (setpoint.q - drive.q) + setpoint.kd * (setpoint.dq - drive.dq) + setpoint.tau;
    drive.tau = powered ? std::clamp(torque, -limit, limit) : 0.0F;
    const bool braked = !powered && config.gravity_compensation;  // a holding brake, so that the arm does not fall
    if (braked) {
      drive.dq = 0.0F;
      continue;
    }
    if (!drive.gripped) drive.gripped_at = drive.q;
    const float per_rad = config.joints[j].limits.per_rad, square = per_rad * per_rad;  // slides: of their motors
    const float hand =
        drive.gripped ? (kHandStiffness * (drive.gripped_at - drive.q) - kHandDamping * drive.dq) / square : 0.0F;
    const float inertia = kTrueInertiaFactor * config.joints[j].inertia;
    drive.dq += dt * (drive.tau + hand - gravity[j] - kFriction / square * drive.dq) / inertia;
    drive.q += dt * drive.dq;
  }
}

const TickOutput& Rig::tick(const CommandChunk* command, OperatorRequest request, Arrival mailbox,
                            std::size_t command_bytes) {
  now = now + config.period;
  ++input.tick;
  input.now = now;
  input.operator_request = request;
  input.messages[Seat::policy].command = command;
  input.messages[Seat::policy].mailbox = command == nullptr && mailbox == Arrival::accepted ? Arrival::none : mailbox;
  input.messages[Seat::policy].bytes =
      command == nullptr ? 0 : (command_bytes != 0 ? command_bytes : command->used_bytes());
  sense();
  control_tick(*state, input, config, *out);
  if (out->observation_due) {
    newest_observation = out->observation.id;
    sensed_at[newest_observation] = out->observation.oldest_sensed_at;
    published_at[newest_observation] = out->observation.published_at;
  }
  move();
  return *out;
}

const TickOutput& Rig::tick_with_policy(float q_target, OperatorRequest request) {
  if (newest_observation == 0 || !out->observation_due) return tick(nullptr, request);
  *scratch_ = chunk_for(config, newest_observation, published_at[newest_observation], now, ++sequence, q_target);
  return tick(scratch_.get(), request);
}

void Rig::arm(float q_target) {
  run_with_policy(40, q_target);
  tick_with_policy(q_target, OperatorRequest::arm);
  for (int i = 0; i < 50 && mode() != Mode::tracking; ++i) tick_with_policy(q_target);
}

}  // namespace takt::pipeline::testing
