// SPDX-License-Identifier: Apache-2.0
// What the numbers of a policy's answers tell about the policy, without a model of it. Every score is 0 where there is
// nothing to say; the larger, the stranger.
//
// A joint's values count in what the joint can do at most within one step: a position target as steps of its velocity
// limit, a velocity target as a share of it, a torque as a share of its torque limit. A score's path is the chunk's own
// steps, or, where chunks have fewer than kPathSteps, the first steps of the newest kAnswers answers; d are the
// differences between its steps.
//
//   temporal_error  root mean square, over joints and steps, of what this answer and the one before say differently
//                   about the same instants (straight lines between the earlier one's steps)
//   reversals       share of neighbouring d of a joint that point in opposite directions, both above kDeadband
//   jerk            rms of second differences of d / (rms of d + kDeadband)
//   inefficiency    1 - distance from first to last step / length of the path, over all joints together
//   stall           share of steps in which no joint is asked to move by more than kDeadband
//   velocity        largest |d|: the plain rule that the others are compared with
//
// Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <vector>

#include "config/chunk_score.hpp"
#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::monitor {

using ChunkScores = std::array<double, config::kChunkScoreCount>;  // in the order of ChunkScore

class ChunkScorer {
 public:
  static constexpr std::size_t kPathSteps = 4;
  static constexpr std::size_t kAnswers = 16;
  static constexpr double kDeadband = 0.01;

  explicit ChunkScorer(const config::RobotConfig& robot);  // precondition: it has a policy

  // `observed_at`: of the observation that the chunk answers: its first step's instant.
  // Precondition: its counts are a chunk's for this robot. Values that it lacks count as 0.
  ChunkScores score(const CommandChunk& chunk, MonoTime observed_at);
  void forget() {
    before_.clear();
    first_steps_.clear();
  }

 private:
  using Step = std::vector<double>;  // one value per joint
  [[nodiscard]] std::vector<Step> steps_of(const CommandChunk& chunk) const;
  [[nodiscard]] double temporal_error(const std::vector<Step>& steps, MonoTime begins, Duration step_period) const;

  CommandField field_;
  std::vector<double> unit_;  // per joint
  std::vector<Step> before_;  // steps of the answer before
  MonoTime before_begins_;
  Duration before_period_;
  std::deque<Step> first_steps_;
};

}  // namespace takt::monitor
