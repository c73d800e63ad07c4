// SPDX-License-Identifier: Apache-2.0
// Everything the tick remembers from one call to the next. Plain value; keyframe.cpp saves and loads its used part, so
// whatever is added here must be added there.
#pragma once

#include <cstdint>
#include <limits>
#include <type_traits>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/bus_watch.hpp"
#include "executive/pipeline/command_in_use.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/freshness.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "executive/pipeline/imu_watch.hpp"
#include "executive/pipeline/join.hpp"
#include "executive/pipeline/joint_watch.hpp"
#include "executive/pipeline/limbs.hpp"
#include "executive/pipeline/observation_memory.hpp"
#include "executive/pipeline/reference_limits.hpp"
#include "executive/pipeline/rest_watch.hpp"
#include "executive/pipeline/tick_window.hpp"
#include "executive/pipeline/velocity_observer.hpp"

namespace takt::pipeline {

struct JointState {
  ObserverState observer;
  ReferenceState reference;            // inside the limits once armed, or on its way back there
  ReferenceState reference_before;     // of the tick before: what the drive still follows if this one's never left
  ReferenceState candidate_reference;  // where the candidate's path would have led since it became usable
  Rates rates;                         // what torque leaves of the acceleration, in this tick (brake.hpp)
  // rad/s^2, of the stop that is known to be possible from `reference`; infinite: at limits.acceleration.
  double brake = std::numeric_limits<double>::infinity();
  float tau_last = 0;     // Nm, torque of the previous tick's setpoint: start of this tick's slew
  float tau_damping = 0;  // Nm, torque of the previous tick's damping
  float kp_before = 0;    // Nm/rad, stiffness by which the drive was pulled to the reference in the previous tick
  std::uint8_t braked_before = 0;  // 1: in the previous tick the reference braked, or stood
  std::uint8_t reserved[3] = {};
  Duration stood_still;   // how long the loop itself stood still since the joint was heard: no silence of its drive
  MonoTime behind_since;  // the joint is further from its reference than following_error; unset: it is not
};

// A loop that stood still for longer knows nothing of its joints any more, whatever the reason.
inline constexpr Duration kLongestExcuse{500'000'000};

struct ModeState {
  MonoTime armed_at;         // start of the present arming
  RestWatch rest;            // latched modes, of the joints that can hold: from then on they do
  RestWatch rest_of_all;     // latched modes, of every joint that has power: until then no reset takes it
  MonoTime stop_pressed_at;  // a person's first press of the stop since standby; unset: none
  MonoTime resumed_at;       // tracking began, after arming or after degraded: start of the resume ramp; unset before
  // Since a fault was latched, or a stop began, until standby: drives that get no power from us, joints that only damp,
  // and those of the others that hold by their stiffness.
  JointMask deenergised = 0;
  JointMask damped = 0;
  JointMask held = 0;
  JointMask holding = 0;  // in the newest tick: Part::holds
  MonoTime awake_since;   // the tick that noticed the newest suspend: feedback from before is not believed; unset: none
  MonoTime degraded_since;  // unset: it is not
  MonoTime stopped_since;   // the damped stop goes on in the manner of stop_cause since then
  MonoTime ticked_at;       // the tick before; unset: there was none
  Mode mode = Mode::standby;
  std::uint8_t resting = 0;           // latched modes: 1 once at rest; from then on what may hold its position does
  std::uint8_t drives_enabled = 0;    // 1 once every drive reported enabled in this arming
  Player player = Player::none;       // in the newest tick
  Player last_player = Player::none;  // the newest one since arming, whichever plays now
  Cause stop_cause = Cause::none;     // in a damped stop: by whose manner
  std::uint8_t reserved[2] = {};
};

struct Counters {
  std::uint64_t next_observation_ordinal = 0;  // tick / observation_every_ticks at which the next one is due
  std::uint32_t integration_errors = 0;
  std::uint32_t refused_commands = 0;
};

// An answer that came before all of the path was played that its observation promised.
struct WaitingCommand {
  CommandInUse command;  // sequence 0: none waits
  MonoTime due;          // when it takes over
};

// The policy of one seat. Its messages are judged in every tick.
struct SeatState {
  CommandInUse command;
  std::uint64_t last_sequence = 0;  // of the last accepted command of its session
  std::uint8_t session = 0;
  Arrival last_refusal = Arrival::none;  // of the newest message
  std::uint8_t reserved[6] = {};
  JoinState join;
  CommandChunk chunk;  // the path in use; only its used part is ever written or read
};

// What the fallback's seat has alone (FallbackKind::policy).
struct FallbackState {
  MonoTime last_usable_at;
  MonoTime plays_since;  // unset: it does not
};

// What the candidate's seat has alone (candidate.hpp).
struct CandidateState {
  std::uint64_t policy_hash = 0;  // while the candidate is in charge: whose commands are taken from its mailbox
  MonoTime asked_at;              // a change was asked for; unset: none is
  Duration probation_left;        // of tracking; 0: not on probation
  std::uint8_t in_charge = 0;     // 1: the candidate's mailbox is the policy's, and the other way round
  std::uint8_t reserved[7] = {};
};

// What keyframes need to know about the configuration the state was made for.
struct StateShape {
  std::uint32_t joint_count = 0;
  std::uint32_t window_ticks = 0;
  std::uint32_t remembered = 0;  // observations
};

struct TickState {
  StateShape shape;
  GravityModel gravity;  // constants of the configuration, as are the limbs: not in keyframes
  Limbs limbs;
  JointMask scarce = 0;  // likewise: joints whose brake asks for a look at what torque is left (brake.hpp)
  ModeState mode;
  Counters counters;
  Recovery recovery;
  ObservationMemory memory;
  TickWindow misses;
  TickWindow refusals;          // messages refused for what they say
  TickWindow clamped;           // ticks that played a target of the policy's out of its joint's range
  TickWindow fallback_clamped;  // likewise, of the fallback policy's
  TickWindow late;              // periods late or skipped
  LinkWatch links;
  ImuWatch imu;
  JointState joints[kMaxJoints];
  JointWatch feedback[kMaxJoints];
  WaitingCommand waiting;  // of the policy
  FallbackState fallback;
  CandidateState candidate;
  TickWindow candidate_misses;    // on probation, as are the next two
  TickWindow candidate_refusals;  // messages refused for what they say
  TickWindow candidate_clamped;   // ticks that played a target out of its joint's range
  PerSeat<SeatState> seats;
  CommandChunk waiting_chunk;  // as SeatState::chunk
};

static_assert(std::is_trivially_copyable_v<TickState>);
// No hidden padding: keyframes of equal states are equal bytes.
static_assert(sizeof(JointState) == sizeof(ObserverState) + 3 * sizeof(ReferenceState) + 56 &&
              sizeof(ObserverState) == 16);
static_assert(sizeof(RestWatch) == 16 + 4 * kMaxJoints && sizeof(ModeState) == 96 + 2 * sizeof(RestWatch) &&
              sizeof(Counters) == 16 && sizeof(Recovery) == 40);
static_assert(sizeof(CommandInUse) == 72 && sizeof(WaitingCommand) == 80 &&
              sizeof(SeatState) == 88 + sizeof(JoinState) + sizeof(CommandChunk) && sizeof(FallbackState) == 16 &&
              sizeof(CandidateState) == 32);
static_assert(sizeof(JoinState) == 8 + 12 * kMaxJoints + 168);
// What a cache has to hold: each seat's chunk, and one that waits, are nine tenths of it.
static_assert(sizeof(TickState) <= (kSeatCount + 1) * 125'000);
static_assert(sizeof(ImuWatch) == 2 * sizeof(ImuSample) + 8 + 16);

}  // namespace takt::pipeline
