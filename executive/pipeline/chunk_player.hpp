// Where the chunk in use stands at an instant: targets as its steps are declared to mean (Interpolation).
//
// Step k belongs to observed_at + k * step_period. hold: its values are the targets for one step period. linear:
// positions follow a straight line to the next step's; cubic: a Hermite curve through positions and velocities; in
// both, gains and feed-forward torque follow straight lines, and the last step's target is held for its period. After
// it the chunk is spent (freshness_of says missing and nothing may be played).
//
// Each step's value is brought into its joint's range before anything is made of it: q to the position limits and
// target_margin around them, dq to the velocity limit, gains to kGainTolerance times their maximum and not below 0,
// tau_ff to the torque limit. A joint for which that changed something is marked (`out_of_range`).
// Precondition of play(): the command is usable at `now`. Fields absent take the joint's defaults.
#pragma once

#include <cstdint>
#include <span>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr float kGainTolerance = 2.0F;  // up to it a gain is limited (gain_limit) and not out of range

// What one joint should do at this tick, before any constraint.
struct JointTarget {
  float q;            // rad
  float dq;           // rad/s, slope of the path there
  float kp, kd;       // Nm/rad, Nm s/rad
  float tau_ff;       // Nm
  float speed;        // rad/s, speed limit of the reference
  float dq_held;      // rad/s, velocity setpoint where the reference's own is none (Interpolation::hold)
  bool out_of_range;  // a value was brought into the joint's range
};

// Fills everything but speed of every joint. Returns the step being played.
std::uint8_t play(const CommandChunk& chunk, MonoTime observed_at, MonoTime now, const TickConfig& config,
                  std::span<JointTarget> targets);

}  // namespace takt::pipeline
