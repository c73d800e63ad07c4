// Impedance law, barriers on the measured state, torque and slew limits; result: fields for a drive-side impedance.
//
//   wanted = kp (q_ref - q) + kd (dq_ref - dq) + tau_ff + gravity        q, dq: the estimate at this tick
//   barrier: the part of `wanted` beyond gravity may not accelerate the joint past a speed limit, nor past the speed
//            from which it can brake before the position barrier, within kBarrierTimeConstants observer time constants:
//            |tau - gravity| <= inertia * (allowed - dq) / T on either side. Inertia is the joint's lower bound, so
//            a heavier joint only reacts more slowly. Position barrier: halfway into the hard margin, so that a
//            reference resting on its limit is left alone; speed barrier: halfway between velocity and velocity_hard.
//   torque limit, then slew limit from the previous tick's torque.
//
// Nothing intervened: the drive gets (q_ref, dq_ref, kp, kd, tau_ff + gravity) and closes the loop at its own rate.
// Else the feed-forward absorbs the difference, and where it alone cannot, the gains are scaled down: in both cases the
// drive produces the limited torque at this tick's estimate and keeps what stiffness and damping it may.
#pragma once

#include "executive/contract/intervention.hpp"
#include "executive/pipeline/chunk_player.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/pipeline/velocity_observer.hpp"

namespace takt::pipeline {

inline constexpr float kBarrierTimeConstants = 2.0F;

struct StabiliserInput {
  JointMotion reference{};  // rad, rad/s
  JointMotion measured{};
  float kp = 0, kd = 0, tau_ff = 0;
  float gravity = 0;
  float tau_last = 0;  // Nm, previous tick's torque
  bool barriers = false;
};

struct StabiliserOutput {
  JointSetpoint setpoint;
  float tau_total = 0;  // Nm, what the drive produces at this tick's estimate
  InterventionMask interventions = 0;
};

struct TorqueRange {
  float low = 0, high = 0;
};

// Torques beyond gravity that the barriers allow. low <= high.
TorqueRange barrier_range(const JointMotion& measured, const JointConfig& joint);

StabiliserOutput stabilise_joint(const StabiliserInput& in, const JointConfig& joint, float dt);

}  // namespace takt::pipeline
