// SPDX-License-Identifier: Apache-2.0
// What the robot should do in this tick, by mode:
//
// mode           reference                               impedance            gravity  barriers
// standby        follows the measured position           none (limp)          no       no
// arming         follows the measured position           damping              yes      yes
// tracking       the chunk's path; brakes when unusable  the chunk's          yes      yes
// degraded hold  brakes to rest                          default              yes      yes
//          slow  the chunk's path, slower; brakes when unusable
//      fallback  to the fallback pose at its speed       default              yes      yes
//   or, by its   moves with the measured state           none: torque =       no       yes
//       kind                                             -K [q - pose; dq]
//   or, by its   the fallback policy's path; the     the chunk's          yes      yes
//       kind     policy's; brakes when neither is
//                usable
// damped_stop    follows until at rest, then stays       damping; at rest default  yes  yes
//   or, by its   damping: follows for good               damping              yes      yes
//   cause's      hold: brakes to rest and stays          default              yes      yes
//   StopRule     policy: the fallback policy's path;     the chunk's          yes      yes
//                without a usable one as any other stop
//   of a robot that holds at once (TickConfig): each     default              -        yes
//                joint brakes from its measured motion
// fault_latched  as damped_stop, but for
//   the joints it is about: no power                     none (limp)          no       no
//   what hangs on them: follows the measured position    damping              no       no
//   the rest of their limbs: brake from their measured   default              yes      yes
//                motion and stay where that ends
//   every joint, after an error of our own               damping              no       no
//   a joint not heard since a suspend                    damping              no       no
//
// A measured position is followed within the hard margin. A joint that comes to rest beyond it is not held there, which
// would fetch it back: it goes on being damped.
// A passive joint's reference follows its measured position in every mode, and its setpoint has no gains and no torque.
//
// State feedback computes the torque anew in every tick from the executive's own estimates, so that a robot that cannot
// stand still without a controller keeps one when the policy is late. Its reference moves with the measured position
// and velocity: tracking starts from the motion that the fallback leaves behind, without a jump.
//
// Resume ramp: for `resume_over` after tracking began, every joint's speed limit rises linearly from
// `degraded_speed_scale` of it to all of it. What moved on while the robot held is then approached, not rushed at.
// Accelerations, torques and barriers are those of every other tick.
//
// Velocity setpoint: the reference's velocity, so that a moving path is followed without lag. Not where steps are held
// (Interpolation::hold): the reference's chase of a step is no velocity that the policy meant, and kd would make a kick
// of it with every action. There it is the step's own dq, else 0, and stays 0 while that reference is braked.
//
// The chunk is consulted only while the command is usable, so no target ever stems from one older than max_age.
#pragma once

#include <cstdint>
#include <span>

#include "executive/contract/tick_record.hpp"
#include "executive/contract/verdict.hpp"
#include "executive/pipeline/chunk_player.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

enum class Reference : std::uint8_t { follow_measured, move_with_measured, brake, follow_target };

struct Choice {
  Reference reference = Reference::follow_measured;
  bool limp = true;              // no gains, no torque
  bool gravity = false;          // add the gravity model
  bool barriers = false;         // barriers on the measured state
  Player player = Player::none;  // whose command in use the targets come from
  bool moving_setpoint = true;   // velocity setpoint: the reference's velocity; else what the target holds
  std::uint8_t step = 0;         // being played
};

// Of a damped stop, now: what was to last for a while ends as any other stop does. In other modes: rest.
StopManner manner_of(const TickState& state, MonoTime now, const TickConfig& config);

// Reads mode and freshness of `record`, and the joints' estimates.
Choice choose(const TickState& state, const TickRecord& record, const TickConfig& config,
              std::span<JointTarget> targets);

}  // namespace takt::pipeline
