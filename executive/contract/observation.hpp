// What the executive tells a policy about the robot, published into the observation mailbox every policy period.
//
// Source: drive feedback, decoded and filtered by the executive, and the base's IMU where the robot has one. Thread
// rule: plain value, copied whole. The executive remembers (id -> oldest_sensed_at, published_at) itself; what a policy
// says later about an observation is never believed in its place.
#pragma once

#include <cstdint>
#include <type_traits>

#include "executive/contract/imu.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

struct Observation {
  std::uint64_t id = 0;       // 1, 2, 3, ...; 0 means none
  std::uint64_t tick = 0;     // control tick that published it
  MonoTime oldest_sensed_at;  // of the oldest sample inside: a joint's receive stamp, or when the IMU sensed
  MonoTime published_at;
  Duration period;                // time to the next observation
  std::uint32_t joint_count = 0;  // 1..kMaxJoints
  std::uint8_t mode = 0;          // takt::Mode at publication
  std::uint8_t of_candidate = 0;  // 1: the chunk in use came from the candidate's mailbox; 0: from the policy's
  std::uint8_t overtaken = 0;     // in lockstep (Welcome): 1: the answer before was published after this; else 0
  std::uint8_t reserved = 0;
  // The steps of the chunk in use that will be played whatever answers this observation (policy.action.join prefix):
  // committed_count of them, beginning with the one that is being played. 0: none is promised.
  std::uint64_t command_sequence = 0;  // of that chunk; 0: none of this session is in use
  std::uint32_t committed_from = 0;
  std::uint32_t committed_count = 0;
  Positions q;
  Velocities dq;
  Torques tau;             // as the drives report it
  Positions q_setpoint;    // what the drives were last told
  Velocities dq_of_drive;  // as the drives report it; dq is the executive's own estimate
  ImuSample imu;           // newest usable one; sequence 0: the robot has none
};

#define TAKT_OBSERVATION_FIELDS                                                                                        \
  {                                                                                                                    \
    TAKT_FIELD(Observation, id), TAKT_FIELD(Observation, tick), TAKT_FIELD(Observation, oldest_sensed_at),             \
        TAKT_FIELD(Observation, published_at), TAKT_FIELD(Observation, period), TAKT_FIELD(Observation, joint_count),  \
        TAKT_FIELD(Observation, mode), TAKT_FIELD(Observation, of_candidate), TAKT_FIELD(Observation, overtaken),      \
        TAKT_FIELD(Observation, reserved), TAKT_FIELD(Observation, command_sequence),                                  \
        TAKT_FIELD(Observation, committed_from), TAKT_FIELD(Observation, committed_count), TAKT_FIELD(Observation, q), \
        TAKT_FIELD(Observation, dq), TAKT_FIELD(Observation, tau), TAKT_FIELD(Observation, q_setpoint),                \
        TAKT_FIELD(Observation, dq_of_drive), TAKT_FIELD(Observation, imu)                                             \
  }

static_assert(std::is_standard_layout_v<Observation> && std::is_trivially_copyable_v<Observation>);
static_assert(sizeof(Observation) == 64 + 5 * sizeof(Positions) + sizeof(ImuSample));
static_assert(is_gapless(TAKT_OBSERVATION_FIELDS, sizeof(Observation)));
inline constexpr std::uint64_t kObservationLayout = layout_hash(TAKT_OBSERVATION_FIELDS);
#undef TAKT_OBSERVATION_FIELDS

// How many observations must be remembered so that none is forgotten before it is max_age old: all that are published
// within max_age, one for the present, and one because a late wake-up brings two of them closer together by less than a
// control period. period > 0.
constexpr std::int64_t observations_to_remember(Duration max_age, Duration period) {
  return max_age.ns / period.ns + 2;
}
inline constexpr std::int64_t kMaxRememberedObservations = 2048;

}  // namespace takt
