// SPDX-License-Identifier: Apache-2.0
// What the executive tells a policy about the robot, published into the observation mailbox every policy period.
//
// Source: drive feedback, decoded and filtered by the executive, and the base's IMU where the robot has one. Thread
// rule: plain value, copied whole. The executive remembers (id -> oldest_sensed_at, published_at) itself; what a policy
// says later about an observation is never believed in its place.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "executive/contract/imu.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/mode.hpp"
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
template <std::same_as<Observation> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(id),
      TAKT_FIELD(tick),
      TAKT_FIELD(oldest_sensed_at),
      TAKT_FIELD(published_at),
      TAKT_FIELD(period),
      TAKT_FIELD(joint_count),
      TAKT_FIELD_OF(Mode, mode),
      TAKT_FIELD(of_candidate),
      TAKT_FIELD(overtaken),
      TAKT_FIELD(reserved),
      TAKT_FIELD(command_sequence),
      TAKT_FIELD(committed_from),
      TAKT_FIELD(committed_count),
      TAKT_FIELD(q),
      TAKT_FIELD(dq),
      TAKT_FIELD(tau),
      TAKT_FIELD(q_setpoint),
      TAKT_FIELD(dq_of_drive),
      TAKT_FIELD(imu),
  };
}

static_assert(std::is_standard_layout_v<Observation> && std::is_trivially_copyable_v<Observation>);
static_assert(sizeof(Observation) == 64 + 5 * sizeof(Positions) + sizeof(ImuSample));

// How many observations must be remembered so that none is forgotten before it is max_age old: all that are published
// within max_age, one for the present, and one because a late wake-up brings two of them closer together by less than a
// control period. period > 0.
constexpr std::int64_t observations_to_remember(Duration max_age, Duration period) {
  return max_age.ns / period.ns + 2;
}
inline constexpr std::int64_t kMaxRememberedObservations = 2048;

}  // namespace takt
