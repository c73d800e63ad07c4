// SPDX-License-Identifier: Apache-2.0
// What the path in use asks of every joint at an instant: where its steps and what is left of the last join put it.
// A joint for which a step's value had to be brought into its range is marked (`out_of_range`). After its last step the
// chunk is spent (freshness_of says missing and nothing may be played).
//
// Precondition of play(): the command is usable at `now`. Fields absent take the joint's defaults.
#pragma once

#include <cstdint>
#include <span>

#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/join.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

// What a stop leaves of the choice for one joint.
enum class Part : std::uint8_t {
  as_chosen,
  holds,        // brakes from its measured motion and holds where that ends: what it carries lost a drive, or no model
                // says what it carries
  released,     // follows the measured position with damping and gravity: at rest beyond the hard margin
  damped,       // damping only: it hangs on a lost drive, is not heard, or our own arithmetic failed
  deenergised,  // nothing, its drive disabled
};

// What one joint should do at this tick, before any constraint.
struct JointTarget {
  float q;            // rad
  float dq;           // rad/s, slope of the path there
  float kp, kd;       // Nm/rad, Nm s/rad
  float tau_ff;       // Nm
  float speed;        // rad/s, speed limit of the reference
  float dq_held;      // rad/s, velocity setpoint where the reference's own is none (Interpolation::hold)
  bool out_of_range;  // a value was brought into the joint's range
  Part part;          // of the choice that this joint has
};

// Fills everything but speed and part of every joint. Returns the step being played.
std::uint8_t play(const JoinState& join, const Timed& path, MonoTime now, const TickConfig& config,
                  std::span<JointTarget> targets);

}  // namespace takt::pipeline
