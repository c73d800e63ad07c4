// SPDX-License-Identifier: Apache-2.0
// Where the chunks that this policy published lead the robot whatever it answers next (policy.action.join prefix), as
// rows for the steps of the answer: row i is the path at observation.published_at + i * step_period, the instant of the
// answer's step i.
//
// The executive names a chunk by its number in this session and how many of its steps it has promised, the one that is
// being played first (Observation::committed_from). That step began up to a step period before the observation, and
// clocks jitter: taken for the answer's first steps, the chunk's own would be off by a whole step every other time. So
// the path is read at the answer's instants: by what joins its steps where they are joined (linear, cubic), and where
// they are held, by the step that is played for most of the row's period. Values are as published, before clamps.
//
// An answer that came too late for this observation to know of it, after the promise that it had waited for, is taken
// at once: then its path is shown, and not that of the chunk that the observation names.
//
// Remembered are the newest kRemembered chunks of the session, and beyond them the one that is being followed: a
// refused answer leaves an older chunk in use. Nothing is remembered under another join, which promises nothing. Pure.
// Thread rule: one thread; no allocation after construction.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"

namespace takt::client {

class PromisedPath {
 public:
  static constexpr std::size_t kRemembered = 32;

  struct Answer {
    std::uint64_t sequence = 0;  // 0: none
    MonoTime published_at;       // unset: in lockstep, where the next observation says whether it knew
    MonoTime begins;             // the instant of its first step
  };

  // Precondition: robot.policy.
  explicit PromisedPath(const config::RobotConfig& robot);

  // Whatever was published before is no chunk of this session.
  void start_session();
  // A chunk that the executive does not refuse at first sight. answer.sequence: 1, 2, 3, ... of a session.
  void remember(const Answer& answer, const CommandChunk& chunk);
  // `observation` speaks of this policy's chunk. As many rows as it promises, of one value per joint, valid until the
  // next call; null: none, or the chunk is not remembered.
  const float* show(const Observation& observation);

 private:
  struct Published : Answer {
    std::vector<float> q, dq;  // steps * joints; dq: cubic paths only
  };
  [[nodiscard]] const Published* played_after(const Observation& observation) const;
  void show_row(const Published& chunk, Duration since, float* row) const;

  config::Interpolation interpolation_;
  Duration step_period_;
  std::size_t steps_, joints_;
  std::vector<Published> published_;  // empty: nothing is ever promised
  std::uint64_t followed_ = 0, newest_ = 0;
  std::vector<float> rows_;
};

}  // namespace takt::client
