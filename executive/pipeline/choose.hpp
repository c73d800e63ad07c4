// What the robot should do in this tick, by mode:
//
// mode           reference                               impedance            gravity  barriers
// standby        follows the measured position           none (limp)          no       no
// arming         follows the measured position           none (limp)          no       no
// tracking       the chunk's path; brakes when unusable  the chunk's          yes      yes
// degraded hold  brakes to rest                          default              yes      yes
//          slow  the chunk's path, slower; brakes when unusable
//      fallback  to the fallback pose at its speed       default              yes      yes
// damped_stop    follows until at rest, then stays       damping; at rest default  yes  yes
// fault_latched  follows the measured position           damping              no       no
//
// Resume ramp: for `resume_over` after tracking began, every joint's speed limit rises linearly from
// `degraded_speed_scale` of it to all of it. What moved on while the robot held is then approached, not rushed at.
// Accelerations, torques and barriers are those of every other tick.
//
// The chunk is consulted only while the command is usable, so no target ever stems from one older than max_age.
#pragma once

#include <cstdint>
#include <span>

#include "executive/contract/verdict.hpp"
#include "executive/pipeline/chunk_player.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

enum class Reference : std::uint8_t { follow_measured, brake, follow_target };

struct Choice {
  Reference reference = Reference::follow_measured;
  bool limp = true;       // no gains, no torque
  bool gravity = false;   // add the gravity model
  bool barriers = false;  // barriers on the measured state
  bool playing = false;   // targets come from the command in use
  std::uint8_t step = 0;  // being played
};

Choice choose(const TickState& state, Freshness freshness, MonoTime now, const TickConfig& config,
              std::span<JointTarget> targets);

}  // namespace takt::pipeline
