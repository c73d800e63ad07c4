// SPDX-License-Identifier: Apache-2.0
// Joins that need the chunks of before (policy.action.join: blend, ensemble, align, quintic): the policy's host mixes
// them into its answer before it publishes it, and the executive plays what it is sent. old(t) is the path that was
// published before, new(t) the answer; both speak of the same instants, step k of either being meant for k step periods
// after the observation that it answers. Where both say something:
//
//   blend       (1 - s) old + s new, s = new_share (as LeRobot's aggregation of overlapping chunks)
//   ensemble    weighted mean of all predictions, weight decay^i, i = 0 the oldest (ACT, decay = exp(-m)); the weight
//               of what was there falls to zero over the last `taper` of it
//   align       new + (old - new when it is published) (1 - (t - then) / over)
//   quintic     new + the polynomial of degree 5 that takes the differences in position, velocity and acceleration at
//               that instant to zero within `over`; exact at the steps, and between them as they are interpolated
//
// Other joins leave the answer as it is. Nothing is mixed where the robot follows no chunk of this policy, or where the
// two chunks differ in their fields or step period. What the old chunk says beyond a joint's range is brought back
// first: it would pull at the answers after it. Values of an answer that are not finite are published as they are, for
// the executive to refuse, and are not remembered. Pure but for what it remembers; nothing allocates after
// construction. Thread rule: one thread.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/chunk_path.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "policy_host/flow/flow_context.hpp"

namespace takt::policy_host {

// Whether the answers of a policy are sent with earlier ones mixed in.
bool mixes_answers(config::JoinKind kind);

class ChunkMixer {
 public:
  // Precondition: robot.policy. `owner`: whose chunks observations speak of; without an owner they are mixed always.
  explicit ChunkMixer(const config::RobotConfig& robot, PathOwner owner = PathOwner::policy);

  // Whatever was published before says nothing any more: a new session, or a past that is worthless.
  void forget() { header_.step_count = 0; }
  // `answer` answers `observation` and is published at `now`.
  void mix(const Observation& observation, MonoTime now, CommandChunk& answer);

 private:
  // What stands behind one step of an ensemble.
  struct Weight {
    float total = 0;   // of all predictions
    float newest = 0;  // of the newest one
  };
  struct Range {
    float low, high;
  };
  [[nodiscard]] bool is_played(const Observation& observation) const;
  [[nodiscard]] float old_at(std::size_t step, CommandField field, std::size_t joint) const;
  [[nodiscard]] PathPoint old_position(const Place& place, std::size_t joint) const;
  [[nodiscard]] PathPoint position(const CommandChunk& chunk, const Place& place, std::size_t joint) const;
  float share_of_new(std::size_t step, MonoTime due, const Place& place);
  void mix_steps(MonoTime begins, CommandChunk& answer);
  void mix_step(std::size_t step, const Place& place, float share, CommandChunk& answer) const;
  void fade_difference(MonoTime begins, MonoTime now, CommandChunk& answer) const;
  void remember(MonoTime begins, const CommandChunk& answer);

  config::Join join_;
  PathOwner owner_;
  bool is_held_, is_cubic_;
  float decay_;                                                // weight of a prediction over that of the one before it
  std::vector<std::array<Range, kCommandFieldCount>> ranges_;  // per joint
  CommandHeader header_;                                       // of the path; step_count 0: there is none
  MonoTime begins_;
  std::vector<float> values_;
  std::vector<Weight> weights_, weights_before_;  // per step
};

}  // namespace takt::policy_host
