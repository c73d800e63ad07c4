// SPDX-License-Identifier: Apache-2.0
// Keeps a joint's reference, a discrete double integrator q' = q + v' dt, inside position, velocity and acceleration
// limits for ever: a control barrier in closed form.
//
// The safe set is { q_min <= q <= q_max, |v| <= v_max, braking with `acceleration` stops before the limit ahead }.
// Each step picks v' with |v' - v| <= a dt, |v'| <= v_max and q + stopping distance of v' inside the limits. Braking as
// hard as possible is always such a choice (it is what the previous step left room for), so the set is never empty.
// stopping_speed(d) is the exact inverse of the discrete stopping distance dt (v + (v - a dt) + ...), not of the
// continuous v^2 / 2a, which would fall short by up to a dt^2 / 8 and leave the set.
//
// A joint found outside q_min..q_max starts from where it is and may only move inwards, within the same speeds and
// accelerations: it returns, it is not fetched.
//
// Towards a target it moves so that nothing rings: the velocity asked for is the target's own plus one that closes the
// gap, in proportion to it nearby (rate k), further away as fast as kBrakingShare of the acceleration can brake; the
// acceleration asked for leads to that velocity at rate 4 k, and changes by no more than 4 k times the limit per
// second, which is the limit on jerk. k = sqrt(acceleration / (4 kGentleGap)): at rest, a gap of kGentleGap is what
// asks for the whole acceleration. acceleration_limit and velocity_limit say that more than the limit was asked for:
// then the path is one that the joint cannot follow. Stops, and whatever a limit ahead asks for, keep to no limit on
// jerk. Where the torque that gravity leaves cannot do the whole acceleration (Rates), neither is more asked for nor is
// more relied on in braking: brake_reserve. Units: rad, rad/s, s.
#pragma once

#include <limits>

#include "executive/contract/intervention.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

// Double, because one step of a slow joint is smaller than float's spacing of angles.
struct ReferenceState {
  double q = 0;
  double dq = 0;
  double ddq = 0;  // rad/s^2, of the step that led here
};

struct ReferenceStep {
  ReferenceState next;
  InterventionMask interventions = 0;
};

// What torque can do to a joint, rad/s^2 towards q_max and towards q_min; more than limits.acceleration is not asked
// for.
struct Rates {
  double up = std::numeric_limits<double>::infinity();
  double down = std::numeric_limits<double>::infinity();
};

inline constexpr double kGentleGap = 0.005;     // rad, times per_rad
inline constexpr double kBrakingShare = 0.8;    // of the acceleration, when a target is approached
inline constexpr double kFastestPursuit = 0.5;  // of a velocity error in one step, however large the acceleration

// Fastest speed from which a joint that first moves one step can still stop within `distance` (>= 0). 0 where nothing
// brakes.
double stopping_speed(double distance, double acceleration, double dt);
// Distance a joint covers that moves one step at `speed` (>= 0) and then brakes; infinite where nothing does.
double stopping_distance(double speed, double acceleration, double dt);

// One step towards q_target that moves with dq_target, at no more than `speed` (<= limits.velocity).
ReferenceStep step_towards(const ReferenceState& from, float q_target, float dq_target, float speed,
                           const JointLimits& limits, double dt, const Rates& rates = {}, bool limits_jerk = true);
// The state within the hard margin nearest to a measured motion that the limits allow: where following the measurement
// leaves the reference. Outside q_min..q_max it does not move further out.
ReferenceState moving_with(float q, float dq, const JointLimits& limits, double dt);
// The measured position, at rest, within the hard margin.
ReferenceState standing_at(float q, const JointLimits& limits);
// How far a reference may be from its joint: no further than the whole torque can pull it (limits.torque / kp). Where
// the stiffness rises from `kp_before`, it is ahead of the joint by so much less that it pulls no harder: from 0 it
// begins at the joint's motion. It does not move further out of q_min..q_max. Precondition: kp > 0, kp_before >= 0.
ReferenceState kept_near(const ReferenceState& from, float q, float dq, float kp, float kp_before,
                         const JointLimits& limits, double dt);
// Where braking begins: no further from the joint than a spring of `kp` may be let go without throwing `inertia`
// (kg m^2, lower bound) faster than limits.velocity. Precondition: kp > 0.
ReferenceState begin_of_braking(const ReferenceState& from, float q, float dq, float kp, float inertia,
                                const JointLimits& limits, double dt);
// One step of a joint without stiffness: the reference is where the joint is, and its velocity goes on towards
// dq_target inside the limits. It does not follow the joint further out than q_min..q_max.
ReferenceStep step_with_measured(const ReferenceState& from, float q, float dq_target, float speed,
                                 const JointLimits& limits, double dt);
// One step of a target that is held for its period by a drive that is moved by gains: the target itself, inside
// q_min..q_max, at rest. While `speed` is below limits.velocity (resume ramp, slow) no further than that in one step.
ReferenceStep step_to_held(const ReferenceState& from, float q_target, float speed, const JointLimits& limits,
                           double dt);
// One step of braking to rest, at no more than `deceleration`, nor than the limit.
ReferenceStep step_braking(const ReferenceState& from, const JointLimits& limits, double dt,
                           double deceleration = std::numeric_limits<double>::infinity());

}  // namespace takt::pipeline
