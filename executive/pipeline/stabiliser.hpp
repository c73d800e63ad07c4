// SPDX-License-Identifier: Apache-2.0
// The impedance law, barriers on the measured state, torque and slew limits: the only ones on this side of the bus.
// Result: what the drive is told, by who closes the loop (LoopAt).
//
//   wanted = kp (q_ref - q) + kd (dq_ref - dq) + tau_ff + gravity        q, dq: the estimate at this tick
//   barrier: the part of `wanted` beyond gravity may not accelerate the joint past a speed limit, nor past the speed
//            from which it can brake before the position barrier with what torque is left of its acceleration, within
//            kBarrierTimeConstants observer time constants: |tau - gravity| <= inertia * (allowed - dq) / T on either
//            side. Inertia is the joint's lower bound, so a heavier joint only reacts more slowly. Position barrier:
//            halfway into the hard margin, so that a reference resting on its limit is left alone; further out where
//            the joint may stay (`may_stay_at`), so that a joint found outside is not thrown back; speed barrier:
//            halfway between velocity and velocity_hard while a policy plays, velocity while none does.
//   torque limit, then slew limit from the previous tick's torque.
//
// Loop at the drive, and nothing intervened: the drive gets (q_ref, dq_ref, kp, kd, tau_ff + gravity) and closes the
// loop at its own rate. Else the feed-forward absorbs the difference, and where it alone cannot, the gains are scaled
// down: in both cases the drive produces the limited torque at this tick's estimate and keeps what stiffness and
// damping it may. So it is with gains that the drive cannot say (DriveGains). Loop at the host, torque: the limited
// torque, finished. Loop at the host, velocity: dq_ref + kp / kd (q_ref - q), 0 without damping, within the speeds that
// the limit and the barriers allow; no torque of ours reaches the drive.
#pragma once

#include "executive/contract/intervention.hpp"
#include "executive/pipeline/chunk_player.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/reference_limits.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/pipeline/velocity_observer.hpp"

namespace takt::pipeline {

inline constexpr float kBarrierTimeConstants = 2.0F;

// rad/s. A policy's motion reaches limits.velocity, with estimates that are noisy there.
constexpr float speed_barrier_of_play(const JointLimits& limits) {
  return 0.5F * (limits.velocity + limits.velocity_hard);
}

struct StabiliserInput {
  JointMotion reference{};  // rad, rad/s
  JointMotion measured{};
  float kp = 0, kd = 0, tau_ff = 0;
  float gravity = 0;
  float tau_last = 0;  // Nm, previous tick's torque
  bool barriers = false;
  float may_stay_at = 0;    // rad, in use with barriers: outside, they pull back no further than this
  Rates rates{};            // what torque leaves of the acceleration by which the barriers brake (brake.hpp)
  float speed_barrier = 0;  // rad/s, in use with barriers: no torque of ours makes the joint faster
};

struct StabiliserOutput {
  JointSetpoint setpoint;
  float tau_total = 0;  // Nm, what the drive produces at this tick's estimate
  InterventionMask interventions = 0;
};

struct TorqueRange {
  float low = 0, high = 0;
};

// Speeds that the barriers allow. low <= 0 <= high, but for a joint beyond both its barrier and where it may stay.
struct SpeedRange {
  float low = 0, high = 0;
};
SpeedRange barrier_speeds(float q, float may_stay_at, float speed_barrier, const JointLimits& limits,
                          const Rates& rates = {});

// Torques beyond gravity that the barriers allow. low <= high.
TorqueRange barrier_range(const JointMotion& measured, float may_stay_at, float speed_barrier, const JointConfig& joint,
                          const Rates& rates = {});

StabiliserOutput stabilise_joint(const StabiliserInput& in, const JointConfig& joint, float dt);

}  // namespace takt::pipeline
