// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/choose.hpp"

#include <algorithm>

#include "executive/pipeline/mode_machine.hpp"

namespace takt::pipeline {
namespace {

// Whether a latched mode has stiffness.
bool holds(const TickState& state, MonoTime now, const TickConfig& config) {
  const bool rests = state.mode.resting != 0;
  switch (manner_of(state, now, config)) {
    case StopManner::rest:
      return rests;
    case StopManner::damping:
      return false;
    case StopManner::hold:
      return true;
    case StopManner::policy:
      return state.mode.player == Player::fallback || rests;
  }
  return false;
}

// `held`: what of mode.held may be stiff.
Part part_of(const TickState& state, const JointRecord& measured, std::size_t joint, JointMask held,
             const TickConfig& config) {
  const JointMask bit = bit_of_joint(joint);
  if ((state.mode.deenergised & bit) != 0) return Part::deenergised;
  // Right after a suspend a joint's position is unknown: no gravity by a pose of before.
  if ((state.mode.damped & bit) != 0 || !state.joints[joint].observer.sampled_at.is_set()) return Part::damped;
  const JointLimits& limits = config.joints[joint].limits;
  const bool beyond = measured.q_estimate < limits.q_min - limits.q_hard_margin ||
                      measured.q_estimate > limits.q_max + limits.q_hard_margin;
  if (is_latched(state.mode.mode) && beyond) return Part::released;
  return (held & bit) != 0 ? Part::holds : Part::as_chosen;
}

// Gains and speed that apply unless the chunk says otherwise. q stays at the reference: no motion asked for.
void default_targets(const TickState& state, const TickRecord& record, const TickConfig& config,
                     std::span<JointTarget> targets) {
  const Mode mode = state.mode.mode;
  const MonoTime now = record.header.now;
  const bool none_holds = mode == Mode::arming || (is_latched(mode) && !holds(state, now, config));
  const JointMask held = manner_of(state, now, config) == StopManner::damping ? 0 : state.mode.held;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointConfig& joint = config.joints[j];
    const Part part = part_of(state, record.joints[j], j, held, config);
    const bool damping_only = part == Part::as_chosen ? none_holds : part != Part::holds;
    targets[j] = {static_cast<float>(state.joints[j].reference.q),
                  0.0F,
                  damping_only ? 0.0F : joint.kp,
                  damping_only ? joint.damping : joint.kd,
                  0.0F,
                  joint.limits.velocity,
                  0.0F,
                  false,
                  part};
  }
}

void scale_speed(float scale, const TickConfig& config, std::span<JointTarget> targets) {
  for (std::size_t j = 0; j < config.joint_count; ++j) targets[j].speed *= scale;
}

// Share of the speed limits that the resume ramp grants: degraded_speed_scale..1.
float resume_scale(const TickState& state, MonoTime now, const TickConfig& config) {
  const Duration since = now - state.mode.resumed_at;
  if (since >= config.resume_over) return 1.0F;
  const float share =
      static_cast<float>(std::max<std::int64_t>(since.ns, 0)) / static_cast<float>(config.resume_over.ns);
  return config.degraded_speed_scale + (1.0F - config.degraded_speed_scale) * share;
}

// A robot whose policy was trained without a velocity setpoint gets none in any mode: where its path is braked or left
// for a pose the reference's velocity would come as a jump.
bool has_moving_setpoint(const TickConfig& config) {
  return config.interpolation != Interpolation::hold;
}

Choice brake(const TickConfig& config) {
  return {Reference::brake, false, true, true, Player::none, has_moving_setpoint(config), 0};
}

Choice go_to_pose(const TickConfig& config) {
  return {Reference::follow_target, false, true, true, Player::none, has_moving_setpoint(config), 0};
}

Choice play_or_brake(const TickState& state, const TickRecord& record, const TickConfig& config,
                     std::span<JointTarget> targets) {
  Choice choice = brake(config);
  const MonoTime now = record.header.now;
  choice.player = record.header.player;
  const std::optional<Seat> plays = seat_of(choice.player);
  if (!plays) return choice;
  const SeatState& seat = state.seats[*plays];
  choice.step = play(seat.join, {seat.chunk, seat.command.begins()}, now, config, targets);
  choice.reference = Reference::follow_target;
  return choice;
}

Choice stop(const TickState& state, const TickRecord& record, const TickConfig& config,
            std::span<JointTarget> targets) {
  const MonoTime now = record.header.now;
  if (record.header.player == Player::fallback) return play_or_brake(state, record, config, targets);
  if (holds(state, now, config)) return brake(config);
  return {Reference::follow_measured, false, true, true, Player::none, true, 0};
}

Choice go_to_fallback(const TickConfig& config, std::span<JointTarget> targets) {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    targets[j].q = config.joints[j].fallback_pose;
    targets[j].speed = config.joints[j].fallback_speed;
  }
  return go_to_pose(config);
}

// Linear state feedback over every joint, passive ones included: at most kMaxJoints^2 products.
Choice feed_back_state(const TickRecord& record, const TickConfig& config, std::span<JointTarget> targets) {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    float torque = 0.0F;
    for (std::size_t k = 0; k < config.joint_count; ++k) {
      const FeedbackGain& gain = config.feedback_gains[j][k];
      const JointRecord& joint = record.joints[k];
      torque -= gain.position * (joint.q_estimate - config.joints[k].fallback_pose) + gain.velocity * joint.dq_estimate;
    }
    targets[j].kp = 0.0F;
    targets[j].kd = 0.0F;
    targets[j].tau_ff = torque;
  }
  return {Reference::move_with_measured, false, false, true, Player::none, true, 0};
}

Choice fall_back(const TickState& state, const TickRecord& record, const TickConfig& config,
                 std::span<JointTarget> targets) {
  switch (config.fallback) {
    case FallbackKind::pose:
      return go_to_fallback(config, targets);
    case FallbackKind::state_feedback:
      return feed_back_state(record, config, targets);
    case FallbackKind::policy:
      return play_or_brake(state, record, config, targets);
  }
  return brake(config);
}

Choice choose_degraded(const TickState& state, const TickRecord& record, const TickConfig& config,
                       std::span<JointTarget> targets) {
  switch (config.degraded) {
    case DegradedBehaviour::hold:
      return brake(config);
    case DegradedBehaviour::slow:
      scale_speed(config.degraded_speed_scale, config, targets);
      return play_or_brake(state, record, config, targets);
    case DegradedBehaviour::fallback:
      return fall_back(state, record, config, targets);
  }
  return brake(config);
}

}  // namespace

StopManner manner_of(const TickState& state, MonoTime now, const TickConfig& config) {
  if (state.mode.mode != Mode::damped_stop) return StopManner::rest;
  const StopRule& rule = config.stops[static_cast<std::size_t>(state.mode.stop_cause)];
  const bool ends = rule.manner != StopManner::damping;
  const bool is_over = rule.longest > Duration{} && now - state.mode.stopped_since >= rule.longest;
  return ends && is_over ? StopManner::rest : rule.manner;
}

Choice choose(const TickState& state, const TickRecord& record, const TickConfig& config,
              std::span<JointTarget> targets) {
  const Mode mode = state.mode.mode;
  default_targets(state, record, config, targets);
  switch (mode) {
    case Mode::standby:
      return {};
    case Mode::arming:  // drives enable one after another: the first must not let their joints fall
      return {Reference::follow_measured, false, true, true, Player::none, true, 0};
    case Mode::tracking:
      scale_speed(resume_scale(state, record.header.now, config), config, targets);
      return play_or_brake(state, record, config, targets);
    case Mode::degraded:
      return choose_degraded(state, record, config, targets);
    case Mode::damped_stop:
    case Mode::fault_latched:
      return stop(state, record, config, targets);
  }
  return {};
}

}  // namespace takt::pipeline
