// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/reference_limits.hpp"

#include <algorithm>
#include <cmath>

namespace takt::pipeline {
namespace {

// The limits the step works with, widened once.
struct Wide {
  double q_min, q_max, velocity, acceleration, gentle_gap;
  explicit Wide(const JointLimits& limits)
      : q_min(static_cast<double>(limits.q_min)),
        q_max(static_cast<double>(limits.q_max)),
        velocity(static_cast<double>(limits.velocity)),
        acceleration(static_cast<double>(limits.acceleration)),
        gentle_gap(kGentleGap * static_cast<double>(limits.per_rad)) {}
};

// Distance in units of a dt^2, speed in units of a dt: n whole braking steps and a remainder r in [0, 1).
double unit_stopping_speed(double x) {
  const double n = std::floor((std::sqrt(1.0 + 8.0 * x) - 1.0) * 0.5);
  const double r = (x - n * (n + 1.0) * 0.5) / (n + 1.0);
  return n + std::clamp(r, 0.0, 1.0);
}

double unit_stopping_distance(double u) {
  const double n = std::floor(u);
  return (n + 1.0) * (n * 0.5 + (u - n));
}

// The barrier: cuts `speed` (>= 0, towards a limit `distance` away). The root is needed only near the limit.
bool cut_to_stop(double& speed, double distance, double acceleration, double dt) {
  const double room = std::max(distance, 0.0);
  // speed^2 / 2a + speed dt + a dt^2 / 8 < room, without the division
  if (speed * (speed + 2.0 * acceleration * dt) + acceleration * acceleration * dt * dt < 2.0 * acceleration * room)
    return false;
  const double allowed = stopping_speed(room, acceleration, dt);
  if (speed <= allowed) return false;
  speed = allowed;
  return true;
}

// Rates of the pursuit, 1/s.
struct Pursuit {
  double gap;       // of the gap
  double velocity;  // of the velocity error
  Pursuit(const Wide& limits, double dt)
      : gap(std::min(std::sqrt(limits.acceleration / (4.0 * limits.gentle_gap)), kFastestPursuit / (4.0 * dt))),
        velocity(4.0 * gap) {}
};

double closing_speed(double gap, double rate, double acceleration) {
  const double distance = std::abs(gap);
  const double braking = kBrakingShare * acceleration;
  const double near = braking / (rate * rate);
  const double speed = distance <= near ? rate * distance : std::sqrt(2.0 * braking * (distance - 0.5 * near));
  return std::copysign(speed, gap);
}

double clamp_marked(double value, double magnitude, Intervention why, InterventionMask& marks) {
  const double inside = std::clamp(value, -magnitude, magnitude);
  if (inside != value) marks |= bit(why);
  return inside;
}

// Moves on with velocity `wanted`, as far as the limits allow.
ReferenceStep step(const ReferenceState& from, double wanted, const Wide& limits, const Rates& rates, double dt) {
  ReferenceStep step;
  const double up = std::min(rates.up, limits.acceleration), down = std::min(rates.down, limits.acceleration);
  const double inside = std::clamp(wanted, -limits.velocity, limits.velocity);
  double v = std::clamp(inside, from.dq - down * dt, from.dq + up * dt);
  const bool scarce = v > inside ? down < limits.acceleration : v < inside && up < limits.acceleration;
  if (scarce) step.interventions |= bit(Intervention::brake_reserve);
  double magnitude = std::abs(v);
  const double room = v > 0.0 ? limits.q_max - from.q : from.q - limits.q_min;
  const double braking = v > 0.0 ? down : up;
  if (magnitude > 0.0 && cut_to_stop(magnitude, room, braking, dt)) {
    step.interventions |= bit(Intervention::braking_distance);
    if (braking < limits.acceleration) {
      step.interventions |= bit(Intervention::brake_reserve);
      magnitude = std::max(magnitude, std::copysign(from.dq, from.dq * v) - braking * dt);
    }
    v = std::copysign(magnitude, v);
  }
  step.next = {std::clamp(from.q + v * dt, std::min(limits.q_min, from.q), std::max(limits.q_max, from.q)), v,
               (v - from.dq) / dt};
  return step;
}

}  // namespace

double stopping_speed(double distance, double acceleration, double dt) {
  if (acceleration <= 0.0) return 0.0;
  const double unit = acceleration * dt;
  return unit * unit_stopping_speed(distance / (unit * dt));
}

double stopping_distance(double speed, double acceleration, double dt) {
  if (acceleration <= 0.0) return speed > 0.0 ? std::numeric_limits<double>::infinity() : 0.0;
  const double unit = acceleration * dt;
  return unit * dt * unit_stopping_distance(speed / unit);
}

ReferenceStep step_towards(const ReferenceState& from, float q_target, float dq_target, float speed,
                           const JointLimits& limits, double dt, const Rates& rates, bool limits_jerk) {
  const Wide wide(limits);
  const Pursuit pursuit(wide, dt);
  const double asked = static_cast<double>(q_target);
  const double target = std::clamp(asked, wide.q_min, wide.q_max);
  const bool cut = target != asked;
  const double path = cut ? 0.0 : static_cast<double>(dq_target);
  InterventionMask marks = cut ? bit(Intervention::position_limit) : InterventionMask{0};
  // Where the path was one step ago, so that following it exactly means moving with it.
  const double gap = target - path * dt - from.q;
  // A speed limit that was lowered is approached by braking, never by a jump.
  const double top = std::min(static_cast<double>(speed), wide.velocity);
  const double velocity =
      clamp_marked(path + closing_speed(gap, pursuit.gap, wide.acceleration), top, Intervention::velocity_limit, marks);
  const double acceleration =
      clamp_marked(pursuit.velocity * (velocity - from.dq), wide.acceleration, Intervention::acceleration_limit, marks);
  const double jerk = pursuit.velocity * wide.acceleration * dt;
  const double smooth = limits_jerk ? std::clamp(acceleration, from.ddq - jerk, from.ddq + jerk) : acceleration;
  ReferenceStep result = step(from, from.dq + smooth * dt, wide, rates, dt);
  result.interventions |= marks;
  return result;
}

ReferenceState standing_at(float q, const JointLimits& limits) {
  return {static_cast<double>(std::clamp(q, limits.q_min - limits.q_hard_margin, limits.q_max + limits.q_hard_margin)),
          0.0};
}

ReferenceState moving_with(float q, float dq, const JointLimits& limits, double dt) {
  const Wide wide(limits);
  const double at = standing_at(q, limits).q;
  const double room = std::max(dq > 0.0F ? wide.q_max - at : at - wide.q_min, 0.0);
  const double speed = std::min(std::abs(static_cast<double>(dq)), wide.velocity);
  return {at, std::copysign(std::min(speed, stopping_speed(room, wide.acceleration, dt)), static_cast<double>(dq))};
}

namespace {

// Nearest to `wanted` that does not lead the reference further out of its limits than it is.
double not_further_out(double wanted, const ReferenceState& from, const JointLimits& limits) {
  const Wide wide(limits);
  return std::clamp(wanted, std::min(wide.q_min, from.q), std::max(wide.q_max, from.q));
}

// Moves a reference that is further than `window` (rad) from the joint to that distance: from then on it goes away from
// the joint no faster than the joint follows.
ReferenceState within_window(const ReferenceState& from, double window, const ReferenceState& joint,
                             const JointLimits& limits) {
  const double off = from.q - joint.q;
  if (std::abs(off) <= window) return from;
  const double dq = off > 0.0 ? std::min(from.dq, joint.dq) : std::max(from.dq, joint.dq);
  return {not_further_out(joint.q + std::copysign(window, off), from, limits), dq, 0.0};
}

}  // namespace

ReferenceState kept_near(const ReferenceState& from, float q, float dq, float kp, float kp_before,
                         const JointLimits& limits, double dt) {
  const ReferenceState joint = moving_with(q, dq, limits, dt);
  const double share = kp > kp_before ? static_cast<double>(kp_before / kp) : 1.0;
  const ReferenceState ahead{
      not_further_out(joint.q + share * (from.q - joint.q), from, limits),
      joint.dq + share * (from.dq - joint.dq),
      share * from.ddq,
  };
  return within_window(share < 1.0 ? ahead : from, static_cast<double>(limits.torque / kp), joint, limits);
}

ReferenceState begin_of_braking(const ReferenceState& from, float q, float dq, float kp, float inertia,
                                const JointLimits& limits, double dt) {
  const double window = static_cast<double>(limits.velocity * std::sqrt(inertia / kp));
  return within_window(from, window, moving_with(q, dq, limits, dt), limits);
}

ReferenceStep step_with_measured(const ReferenceState& from, float q, float dq_target, float speed,
                                 const JointLimits& limits, double dt) {
  const double at = not_further_out(standing_at(q, limits).q, from, limits);
  const double wanted =
      std::clamp(static_cast<double>(dq_target), -static_cast<double>(speed), static_cast<double>(speed));
  return step({at, from.dq, from.ddq}, wanted, Wide(limits), {}, dt);
}

ReferenceStep step_to_held(const ReferenceState& from, float q_target, float speed, const JointLimits& limits,
                           double dt) {
  const double target = not_further_out(static_cast<double>(q_target), from, limits);
  const bool cut = target != static_cast<double>(q_target);
  const InterventionMask marks = cut ? bit(Intervention::position_limit) : InterventionMask{0};
  const double reach = static_cast<double>(speed) * dt;
  if (speed >= limits.velocity || std::abs(target - from.q) <= reach) return {{target, 0.0, 0.0}, marks};
  return {{from.q + std::copysign(reach, target - from.q), 0.0, 0.0},
          static_cast<InterventionMask>(marks | bit(Intervention::velocity_limit))};
}

ReferenceStep step_braking(const ReferenceState& from, const JointLimits& limits, double dt, double deceleration) {
  const Wide wide(limits);
  const double slower = std::max(std::abs(from.dq) - std::min(deceleration, wide.acceleration) * dt, 0.0);
  return step(from, std::copysign(slower, from.dq), wide, {deceleration, deceleration}, dt);
}

}  // namespace takt::pipeline
