// SPDX-License-Identifier: Apache-2.0
// What a chunk says for one joint at an instant, by its declared interpolation and nothing else: no range, no join.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "executive/contract/command_chunk.hpp"

namespace takt::evidence {

// Between which two steps of a chunk an instant lies, and how far. Before the first step it is the first, after the
// last one the last.
struct ChunkPlace {
  std::size_t step = 0, next = 0;  // equal: the step's own value
  float share = 0;                 // 0..1 of the way to `next`
};

// `since`: step 0's instant. `held`: a step's values hold for its whole period. Precondition: a step, a period.
inline ChunkPlace chunk_place(const CommandHeader& header, Duration since, bool held) {
  const std::int64_t last = header.step_count - 1;
  const std::int64_t ns = std::max<std::int64_t>(since.ns, 0);
  const std::int64_t step = std::min(ns / header.step_period.ns, last);
  const std::int64_t next = held ? step : std::min(step + 1, last);
  const auto of_step = static_cast<float>(ns - step * header.step_period.ns);
  const float share = step == next ? 0.0F : of_step / static_cast<float>(header.step_period.ns);
  return {static_cast<std::size_t>(step), static_cast<std::size_t>(next), share};
}

// Precondition: the chunk has the field and the joint.
inline float chunk_value(const CommandChunk& chunk, CommandField field, const ChunkPlace& place, std::size_t joint) {
  const float from = chunk.values[value_index(chunk.header, field, place.step, joint)];
  const float to = chunk.values[value_index(chunk.header, field, place.next, joint)];
  return from + (to - from) * place.share;
}

}  // namespace takt::evidence
