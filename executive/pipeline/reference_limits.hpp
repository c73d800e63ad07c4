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
// Towards a moving target the same law is applied to the distance left and added to the target's own velocity, so that
// a smooth path is followed without lag. Units: rad, rad/s, s.
#pragma once

#include "executive/contract/intervention.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

// Double, because one step of a slow joint is smaller than float's spacing of angles.
struct ReferenceState {
  double q = 0;
  double dq = 0;
};

struct ReferenceStep {
  ReferenceState next;
  InterventionMask interventions = 0;
};

// Fastest speed from which a joint that first moves one step can still stop within `distance` (>= 0).
double stopping_speed(double distance, double acceleration, double dt);
// Distance a joint covers that moves one step at `speed` (>= 0) and then brakes.
double stopping_distance(double speed, double acceleration, double dt);

// One step towards q_target that moves with dq_target, at no more than `speed` (<= limits.velocity).
ReferenceStep step_towards(const ReferenceState& from, float q_target, float dq_target, float speed,
                           const JointLimits& limits, double dt);
// The state within the hard margin nearest to a measured motion that the limits allow: where following the measurement
// leaves the reference. Outside q_min..q_max it does not move further out.
ReferenceState moving_with(float q, float dq, const JointLimits& limits, double dt);
// The measured position, at rest, within the hard margin.
ReferenceState standing_at(float q, const JointLimits& limits);
// One step of braking to rest.
ReferenceStep step_braking(const ReferenceState& from, const JointLimits& limits, double dt);

}  // namespace takt::pipeline
