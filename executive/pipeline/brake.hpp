// SPDX-License-Identifier: Apache-2.0
// A brake that is always possible: before a step of the references is committed, a stop of the whole robot from there
// is known to stay inside the limits on position, velocity and torque. If it is not, the robot brakes now, along the
// stop that was known before.
//
// The stop of a joint: from its reference it decelerates at one rate of its own, no more than limits.acceleration,
// until it stands. Known of it, before anything moves:
//   position  where it comes to stand lies inside the limits (further in, of a joint that was found outside)
//   velocity  only falls
//   torque    inertia_max * rate, and what gravity asks in the worst pose on the way, are within kBrakeTorque of the
//             limit; so is what gravity asks alone once it stands. The rest is for what the model does not know.
// Gravity is computed where the joints are measured. Until all stand it changes by no more than GravityModel::swing of
// what each joint still moves, its distance from the reference included: a bound, for any pose on the way.
//
// A joint whose torque suffices for its whole acceleration in any pose needs none of this, and neither does one whose
// torque its drive decides (LoopAt::host_velocity, drive_position): then a stop at limits.acceleration is what
// reference_limits.hpp leaves room for. The others are scarce (`scarce_joints`, of the configuration): in every tick
// the rates that torque leaves them bound how their references and, by the barriers, their measured states move, and
// where can_stop() refuses a step all joints that follow a reference brake. Both are marked brake_reserve.
//
// Not in it: torques by which moving joints act on one another beyond inertia_max, and loads that the robot file does
// not state. A policy's feed-forward torque and stiffness end with the step that is refused; what they did to the
// measured state meanwhile is the barriers' affair (stabiliser.hpp). Pure; bounded by joints times depth of the tree.
#pragma once

#include <span>

#include "executive/contract/joints.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "executive/pipeline/reference_limits.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr float kBrakeTorque = 0.9F;  // of the torque limit
inline constexpr int kBrakeRounds = 3;       // gentler and gentler stops are tried before the step is refused

// Joints whose torque does not do their whole acceleration in every pose.
JointMask scarce_joints(const TickConfig& config, const GravityModel& gravity);

// What torque leaves of each joint's acceleration at the measured state, its next stop's change of gravity included;
// limits.acceleration of a joint that is not scarce. Reads estimates and gravity of `record`. One per joint.
void find_rates(const TickRecord& record, JointMask scarce, const GravityModel& gravity, const TickConfig& config,
                std::span<Rates> rates);

// One joint of a robot that is to be stopped.
struct Stopping {
  ReferenceState from;      // its reference; without stiffness, or where it follows none, the measured state
  double deceleration = 0;  // rad/s^2, found: of a stop that is possible
  bool is_braked = false;   // follows its reference: the stop is ours
};

// True: there is a stop from there. Reads estimates and gravity of `record`. `joints`: one per joint.
bool can_stop(std::span<Stopping> joints, const TickRecord& record, JointMask scarce, const GravityModel& gravity,
              const TickConfig& config);

}  // namespace takt::pipeline
