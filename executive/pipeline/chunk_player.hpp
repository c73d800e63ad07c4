// Where the chunk in use stands at an instant: targets interpolated between its steps.
//
// Step k belongs to observed_at + k * step_period. Between two steps positions follow a straight line, or a cubic
// Hermite when the chunk carries dq; gains and feed-forward torque follow a straight line. During the last step's
// period its target is held; after it the chunk is spent (freshness_of says missing and nothing may be played).
// Precondition of play(): the command is usable at `now`. Fields absent take the joint's defaults.
#pragma once

#include <cstdint>
#include <span>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

// What one joint should do at this tick, before any constraint.
struct JointTarget {
  float q;       // rad
  float dq;      // rad/s, slope of the path there
  float kp, kd;  // Nm/rad, Nm s/rad
  float tau_ff;  // Nm
  float speed;   // rad/s, speed limit of the reference
};

// Fills q, dq, kp, kd and tau_ff of every joint; leaves speed alone. Returns the step being played.
std::uint8_t play(const CommandChunk& chunk, MonoTime observed_at, MonoTime now, const TickConfig& config,
                  std::span<JointTarget> targets);

}  // namespace takt::pipeline
