// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/stabiliser.hpp"

#include <algorithm>
#include <cmath>

namespace takt::pipeline {
namespace {

constexpr float kReturnRate = 10.0F;  // 1/s: beyond the position barrier the allowed speed points back at this rate

float impedance_torque(const JointSetpoint& setpoint, const JointMotion& measured) {
  return setpoint.kp * (setpoint.q - measured.q) + setpoint.kd * (setpoint.dq - measured.dq);
}

// Fastest speed towards a barrier that is `distance` away.
float allowed_speed(float distance, float speed_limit, float braking) {
  if (distance <= 0.0F) return std::max(distance * kReturnRate, -speed_limit);
  if (2.0F * braking * distance >= speed_limit * speed_limit) return speed_limit;
  return std::sqrt(2.0F * braking * distance);
}

float clamp_marked(float value, float low, float high, Intervention why, InterventionMask& marks) {
  const float clamped = std::clamp(value, low, high);
  if (clamped != value) marks |= bit(why);
  return clamped;
}

// Which barrier binds decides the name of the intervention.
float apply_barriers(float torque, const StabiliserInput& in, const JointConfig& joint, InterventionMask& marks) {
  const TorqueRange range = barrier_range(in.measured, in.may_stay_at, in.speed_barrier, joint, in.rates);
  const float beyond = torque - in.gravity;
  const float allowed = std::clamp(beyond, range.low, range.high);
  if (allowed == beyond) return torque;
  const float per_speed = joint.inertia * joint.observer_bandwidth / kBarrierTimeConstants;
  const float by_speed = per_speed * (in.speed_barrier - std::copysign(1.0F, beyond) * in.measured.dq);
  const bool speed_binds = std::abs(allowed) >= by_speed;
  marks |= bit(speed_binds ? Intervention::velocity_barrier : Intervention::position_barrier);
  return in.gravity + allowed;
}

// Fields that make the drive produce `wanted` at the measured state, each inside its limits.
void fit_to_torque(JointSetpoint& setpoint, float wanted, const JointMotion& measured, float torque_limit) {
  const float impedance = impedance_torque(setpoint, measured);
  setpoint.tau = std::clamp(wanted - impedance, -torque_limit, torque_limit);
  const float left = wanted - setpoint.tau;
  if (std::abs(impedance) <= std::abs(left)) return;
  const float scale = left / impedance;
  setpoint.kp *= scale;
  setpoint.kd *= scale;
}

// Gains that the drive can say; true: some were not.
bool fit_gains(JointSetpoint& setpoint, const DriveGains& drive) {
  if (drive.kp <= 0.0F) return false;
  const float kp = std::min(setpoint.kp, drive.kp);
  const float kd = std::min(setpoint.kd, drive.kd * (kp / drive.kp));
  const bool changed = kp != setpoint.kp || kd != setpoint.kd;
  setpoint.kp = kp;
  setpoint.kd = kd;
  return changed;
}

StabiliserOutput finished_velocity(const StabiliserInput& in, const JointLimits& limits) {
  StabiliserOutput out;
  const float kp = clamp_marked(in.kp, 0.0F, limits.kp_max, Intervention::gain_limit, out.interventions);
  const float kd = clamp_marked(in.kd, 0.0F, limits.kd_max, Intervention::gain_limit, out.interventions);
  float velocity = kd > 0.0F ? in.reference.dq + kp * (in.reference.q - in.measured.q) / kd : 0.0F;
  velocity = clamp_marked(velocity, -limits.velocity, limits.velocity, Intervention::velocity_limit, out.interventions);
  if (in.barriers) {
    const SpeedRange speeds = barrier_speeds(in.measured.q, in.may_stay_at, in.speed_barrier, limits, in.rates);
    velocity = clamp_marked(velocity, std::clamp(speeds.low, -limits.velocity, limits.velocity),
                            std::clamp(speeds.high, -limits.velocity, limits.velocity), Intervention::position_barrier,
                            out.interventions);
  }
  out.setpoint = {in.reference.q, velocity, 0.0F, 0.0F, 0.0F};
  return out;
}

}  // namespace

SpeedRange barrier_speeds(float q, float may_stay_at, float speed_barrier, const JointLimits& limits,
                          const Rates& rates) {
  const float brakes_up = std::min(limits.acceleration, static_cast<float>(rates.down));
  const float brakes_down = std::min(limits.acceleration, static_cast<float>(rates.up));
  const float outside = 0.5F * limits.q_hard_margin;
  const float above = std::max(limits.q_max + outside, may_stay_at) - q;
  const float below = q - std::min(limits.q_min - outside, may_stay_at);
  float up = allowed_speed(above, speed_barrier, brakes_up);
  float down = -allowed_speed(below, speed_barrier, brakes_down);
  if (up < down) (above < 0.0F ? down : up) = above < 0.0F ? up : down;
  return {down, up};
}

TorqueRange barrier_range(const JointMotion& measured, float may_stay_at, float speed_barrier, const JointConfig& joint,
                          const Rates& rates) {
  const SpeedRange speeds = barrier_speeds(measured.q, may_stay_at, speed_barrier, joint.limits, rates);
  const float per_speed = joint.inertia * joint.observer_bandwidth / kBarrierTimeConstants;
  return {per_speed * (speeds.low - measured.dq), per_speed * (speeds.high - measured.dq)};
}

StabiliserOutput stabilise_joint(const StabiliserInput& in, const JointConfig& joint, float dt) {
  if (joint.loop == LoopAt::host_velocity) return finished_velocity(in, joint.limits);
  const JointLimits& limits = joint.limits;
  StabiliserOutput out;
  InterventionMask& marks = out.interventions;
  const float kp = clamp_marked(in.kp, 0.0F, limits.kp_max, Intervention::gain_limit, marks);
  const float kd = clamp_marked(in.kd, 0.0F, limits.kd_max, Intervention::gain_limit, marks);
  out.setpoint = {in.reference.q, in.reference.dq, kp, kd, in.tau_ff + in.gravity};
  const float wanted = impedance_torque(out.setpoint, in.measured) + out.setpoint.tau;
  float torque = in.barriers ? apply_barriers(wanted, in, joint, marks) : wanted;
  torque = clamp_marked(torque, -limits.torque, limits.torque, Intervention::torque_limit, marks);
  const float slew = limits.torque_rate * dt;
  torque = clamp_marked(torque, in.tau_last - slew, in.tau_last + slew, Intervention::torque_rate_limit, marks);
  const bool feed_forward_too_big = std::abs(out.setpoint.tau) > limits.torque;
  if (feed_forward_too_big) marks |= bit(Intervention::torque_limit);
  if (joint.loop == LoopAt::host_torque) {
    out.setpoint = {in.reference.q, in.reference.dq, 0.0F, 0.0F, torque};
    out.tau_total = torque;
    return out;
  }
  const bool unspeakable = fit_gains(out.setpoint, joint.drive_gains);
  if (torque != wanted || feed_forward_too_big || unspeakable)
    fit_to_torque(out.setpoint, torque, in.measured, limits.torque);
  out.tau_total = impedance_torque(out.setpoint, in.measured) + out.setpoint.tau;
  return out;
}

}  // namespace takt::pipeline
