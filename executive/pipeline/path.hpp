// SPDX-License-Identifier: Apache-2.0
// Where a chunk's path stands at an instant, joint by joint: what its steps are declared to mean (Interpolation), each
// value brought into its joint's range first.
//
// Step k belongs to observed_at + k * step_period. hold: its values are the targets for one step period. linear:
// positions follow a straight line to the next step's; cubic: a Hermite curve through positions and velocities; in
// both, gains and feed-forward torque follow straight lines, and the last step's target is held for its period. Pure.
#pragma once

#include <algorithm>
#include <cstddef>

#include "executive/contract/chunk_path.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr float kGainTolerance = 2.0F;  // up to it a gain is limited (gain_limit) and not out of range

// `since`: the first step's instant; before it the first step counts, after the end the last.
Place place_of(const CommandHeader& header, Duration since, Interpolation interpolation);

// What a value of a chunk may be; beyond it it is brought back.
struct Range {
  float low, high;
};
Range range_of(CommandField field, const JointLimits& limits);

// One joint's values at the two steps around the instant. Precondition: the place is one of the chunk's.
class PathReader {
 public:
  PathReader(const CommandChunk& chunk, const Place& place, std::size_t joint, const JointLimits& limits)
      : chunk_(chunk), place_(place), joint_(joint), limits_(limits) {}

  [[nodiscard]] bool has(CommandField field) const {
    return (chunk_.header.fields & static_cast<unsigned>(field)) != 0;
  }
  [[nodiscard]] bool out_of_range() const { return out_of_range_; }  // any value read so far
  float here(CommandField field) { return at(place_.step, field); }
  float next(CommandField field) { return at(place_.next, field); }
  float blend(CommandField field, float otherwise);
  PathPoint position(Interpolation interpolation);

 private:
  float at(std::size_t step, CommandField field);

  const CommandChunk& chunk_;
  const Place& place_;
  std::size_t joint_;
  const JointLimits& limits_;
  bool out_of_range_ = false;
};

}  // namespace takt::pipeline
