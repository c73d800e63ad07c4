#include "executive/pipeline/speculation.hpp"

#include <algorithm>
#include <cmath>

#include "executive/pipeline/messages.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {
namespace {

bool assumes(const CommandHeader& header, Assumption what) {
  return (header.assumes & static_cast<unsigned>(what)) != 0;
}

// From the state sensed, in tolerances, of the joint that is farthest.
float distance_of(const Alternative& alternative, std::span<const JointRecord> sensed,
                  const SpeculationTolerance& tolerance) {
  const CommandHeader& header = alternative.header;
  const std::size_t steps = header.step_count * header.joint_count * field_count(header.fields);
  const std::span<const float> q(alternative.values.data() + steps, sensed.size());
  float distance = 0.0F;
  for (std::size_t j = 0; j < sensed.size(); ++j)
    distance = std::max(distance, std::abs(q[j] - sensed[j].q_estimate) / tolerance.q);
  if (!assumes(header, Assumption::dq)) return distance;
  const std::span<const float> dq(q.data() + q.size(), sensed.size());
  for (std::size_t j = 0; j < sensed.size(); ++j)
    distance = std::max(distance, std::abs(dq[j] - sensed[j].dq_estimate) / tolerance.dq);
  return distance;
}

// Its instant has come, and it may still move the robot.
bool is_comparable(const TickState& state, const CommandInUse& command, MonoTime now, const TickConfig& config) {
  return now < command.begins() + config.period && command.age(now) <= config.freshness.max_age &&
         command.observation_id >= newest_command(state).observation_id;
}

// Until then the path of before is played, whatever answers the newest observation; unset: nothing is promised.
MonoTime promised_until(const TickState& state, const TickConfig& config) {
  RememberedObservation newest;
  const auto recall = state.memory.recall(state.memory.newest(), remembered_observations(config), newest);
  return recall == ObservationMemory::Recall::known ? newest.committed_until : MonoTime{};
}

// From now on a chunk like any other, whose first step is meant for the assumed instant.
void take(TickState& state, const Alternative& alternative, const TickConfig& config) {
  state.waiting = {alternative.command, promised_until(state, config)};
  state.waiting_chunk.header = alternative.header;
  state.waiting_chunk.header.assumes = 0;
  state.waiting_chunk.header.assumed_at = {};
  std::copy_n(alternative.values.data(), state.waiting_chunk.value_count(), state.waiting_chunk.values);
}

}  // namespace

bool is_sound_assumption(const CommandChunk& chunk, bool may_speculate, const TickConfig& config) {
  const CommandHeader& header = chunk.header;
  if (header.assumes == 0) return !header.assumed_at.is_set();
  return may_speculate && config.speculation.q > 0.0F && header.assumes <= kAllAssumptions &&
         assumes(header, Assumption::q) && header.assumed_at.is_set() &&
         alternative_values(header) <= kMaxAlternativeValues;
}

void keep_alternative(SpeculationState& state, const CommandChunk& chunk, const CommandInUse& command) {
  const auto by_sequence = [](const Alternative& one) { return one.command.sequence; };
  Alternative& place = *std::ranges::min_element(state.waiting, {}, by_sequence);  // a free one has sequence 0
  state.dropped += place.command.sequence != 0 ? 1U : 0U;
  place.command = command;
  place.header = chunk.header;
  std::copy_n(chunk.values, alternative_values(chunk.header), place.values.data());
}

void drop_alternatives(SpeculationState& state) {
  for (Alternative& one : state.waiting) {
    state.dropped += one.command.sequence != 0 ? 1U : 0U;
    one.command = {};
  }
}

void compare_alternatives(TickState& state, MonoTime now, const TickConfig& config, TickRecord& record) {
  SpeculationState& speculation = state.speculation;
  SpeculationRecord& out = record.header.speculation;
  const std::span<const JointRecord> sensed(record.joints, config.joint_count);
  Alternative* nearest = nullptr;
  std::uint32_t matching = 0;
  for (Alternative& one : speculation.waiting) {
    if (one.command.sequence == 0 || now < one.command.begins()) continue;
    if (!is_comparable(state, one.command, now, config)) {
      ++speculation.dropped;
      one.command = {};
      continue;
    }
    const float distance = distance_of(one, sensed, config.speculation);
    if (out.compared == 0 || distance < out.distance) {
      out.distance = distance;
      nearest = &one;
    }
    ++out.compared;
    if (distance <= 1.0F) ++matching;
  }
  speculation.unmatched += out.compared - matching;
  if (matching > 0) {
    take(state, *nearest, config);
    out.taken_sequence = nearest->command.sequence;
    ++speculation.taken;
    speculation.outdone += matching - 1;
  }
  for (Alternative& one : speculation.waiting) {
    if (one.command.sequence == 0) continue;
    if (now >= one.command.begins())
      one.command = {};
    else
      ++out.waiting;
  }
  out.taken = speculation.taken;
  out.outdone = speculation.outdone;
  out.unmatched = speculation.unmatched;
  out.dropped = speculation.dropped;
}

}  // namespace takt::pipeline
