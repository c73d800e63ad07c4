// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/repeat_last.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "evidence/rollout/chunk_value.hpp"

namespace takt::evidence {
namespace {

// One value of a joint's target `since` the source's observation: held or linear between steps, the last one for ever,
// at rest there.
float value_at(const CommandChunk& chunk, CommandField field, Duration since, std::size_t joint, bool held) {
  const ChunkPlace place = chunk_place(chunk.header, since, held);
  const bool rests = !held && place.step == place.next;
  return rests && field == CommandField::dq ? 0.0F : chunk_value(chunk, field, place, joint);
}

}  // namespace

void RepeatLast::pass(const ArrivedCommand& command) {
  CommandChunk& chunk = *command.chunk;
  chunk.header.sequence = ++sequence_;
  due_ = false;
  const std::span values(chunk.values, chunk.value_count());
  if (!std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) return;
  source_observed_at_ = command.observed_at;
  const MonoTime outside = chunk.header.outside_sensed_at;
  source_sensed_at_ = outside.is_set() ? std::min(outside, command.sensed_at) : command.sensed_at;
  source_->header = chunk.header;
  std::ranges::copy(values, source_->values);
  has_source_ = true;
}

void RepeatLast::observe(const Observation& observation) {
  const CommandHeader& from = source_->header;
  const MonoTime now = observation.published_at;
  if (!has_source_ || source_observed_at_ + from.step_period * from.step_count > now + observation.period * 2) return;
  CommandHeader& header = repeated_->header;
  header = from;
  header.observation_id = observation.id;
  header.sequence = ++sequence_;
  header.outside_sensed_at = source_sensed_at_;
  header.dequeued_at = header.infer_started_at = header.infer_ended_at = header.published_at = now;
  for (std::size_t step = 0; step < header.step_count; ++step) {
    const Duration since = now - source_observed_at_ + header.step_period * static_cast<std::int64_t>(step);
    for (unsigned bit = 0; bit < kCommandFieldCount; ++bit) {
      if ((static_cast<unsigned>(header.fields) >> bit & 1U) == 0) continue;
      const auto field = static_cast<CommandField>(1U << bit);
      for (std::size_t joint = 0; joint < header.joint_count; ++joint)
        repeated_->values[value_index(header, field, step, joint)] = value_at(*source_, field, since, joint, held_);
    }
  }
  due_ = true;
}

const CommandChunk* RepeatLast::read() {
  if (!due_) return nullptr;
  due_ = false;
  return repeated_.get();
}

}  // namespace takt::evidence
