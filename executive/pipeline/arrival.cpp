// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/arrival.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace takt::pipeline {
namespace {

bool is_well_shaped(const CommandChunk& chunk, std::size_t bytes, const TickConfig& config) {
  if (bytes < sizeof(CommandHeader) || bytes > config.largest_command) return false;
  const CommandHeader& header = chunk.header;
  if (header.step_count < 1 || header.step_count > kMaxChunkSteps) return false;
  if (header.joint_count != config.joint_count) return false;
  if ((header.fields & static_cast<unsigned>(CommandField::q)) == 0 || header.fields > kAllCommandFields) return false;
  // Velocities are part of a cubic path, and mean nothing on a straight one.
  const bool with_dq = (header.fields & static_cast<unsigned>(CommandField::dq)) != 0;
  if (config.interpolation != Interpolation::hold && with_dq != (config.interpolation == Interpolation::cubic))
    return false;
  if (!std::all_of(std::begin(header.reserved), std::end(header.reserved), [](std::uint8_t b) { return b == 0; }))
    return false;
  if (header.step_period <= Duration{0} || header.step_period > kLongestStepPeriod) return false;
  return bytes == chunk.used_bytes();
}

Arrival judge_observation(ObservationMemory::Recall recall) {
  switch (recall) {
    case ObservationMemory::Recall::known:
      return Arrival::accepted;
    case ObservationMemory::Recall::never_published:
      return Arrival::unknown_observation;
    case ObservationMemory::Recall::not_yet_published:
      return Arrival::future_observation;
    case ObservationMemory::Recall::forgotten:
      return Arrival::expired_observation;
  }
  return Arrival::unknown_observation;
}

// A tick's instant is its wake-up, and the mailbox is read somewhat later: a prompt policy may have published in
// between. More than a period ahead is a lie.
bool claims_the_future(const CommandHeader& header, MonoTime now, Duration period) {
  return std::max({header.outside_sensed_at, header.dequeued_at, header.infer_started_at, header.infer_ended_at,
                   header.published_at}) > now + period;
}

bool runs_backwards(const CommandHeader& header, MonoTime observed_at) {
  return header.dequeued_at < observed_at || header.infer_started_at < header.dequeued_at ||
         header.infer_ended_at < header.infer_started_at || header.published_at < header.infer_ended_at;
}

Arrival judge_values(const CommandChunk& chunk) {
  const std::span values(chunk.values, chunk.value_count());
  if (!std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) return Arrival::not_finite;
  const bool sensible = std::ranges::all_of(values, [](float value) { return std::abs(value) <= kLargestTarget; });
  return sensible ? Arrival::accepted : Arrival::out_of_range;
}

CommandInUse believed(const CommandHeader& header, const Sender& sender, const RememberedObservation& observation,
                      MonoTime now) {
  CommandInUse command;
  command.sequence = header.sequence;
  command.observation_id = header.observation_id;
  command.sensed_at = observation.oldest_sensed_at;
  if (header.outside_sensed_at.is_set()) command.sensed_at = std::min(command.sensed_at, header.outside_sensed_at);
  command.observed_at = observation.published_at;
  command.infer_started_at = std::clamp(header.infer_started_at, command.observed_at, now);
  command.infer_ended_at = std::clamp(header.infer_ended_at, command.infer_started_at, now);
  command.first_used_at = now;
  command.policy_hash = header.policy_hash;
  command.session = sender.session;
  command.of_candidate = sender.of_candidate;
  return command;
}

}  // namespace

ArrivalVerdict judge_arrival(const CommandChunk& chunk, std::size_t bytes, MonoTime now, const Sender& sender,
                             const ObservationMemory& memory, const TickConfig& config, Arrival values) {
  const auto refused = [](Arrival why, bool backwards = false) { return ArrivalVerdict{why, backwards, {}, {}}; };
  if (!is_well_shaped(chunk, bytes, config)) return refused(Arrival::wrong_shape);
  const CommandHeader& header = chunk.header;
  const ExpectedPolicy& expected = sender.expected;
  if (expected.hash != 0 && header.policy_hash != expected.hash) return refused(Arrival::wrong_policy);
  if (header.sequence <= sender.last_sequence) return refused(Arrival::repeated_sequence);
  RememberedObservation observation;
  if (const Arrival known =
          judge_observation(memory.recall(header.observation_id, remembered_observations(config), observation));
      known != Arrival::accepted)
    return refused(known);
  if (expected.needs_outside_stamp && !header.outside_sensed_at.is_set()) return refused(Arrival::missing_stamp);
  if (claims_the_future(header, now, config.period)) return refused(Arrival::future_observation);
  const bool backwards = runs_backwards(header, observation.published_at);
  if (values == Arrival::none) values = judge_values(chunk);
  if (values != Arrival::accepted) return refused(values, backwards);
  const CommandInUse command = believed(header, sender, observation, now);
  // Compared as instants: a claimed stamp may be so far back that its age would overflow.
  if (command.sensed_at < now - config.freshness.max_age) return refused(Arrival::expired_observation, backwards);
  if (command.observation_id < sender.newest.observation_id) return refused(Arrival::overtaken, backwards);
  return {Arrival::accepted, backwards, command, observation.committed_until};
}

}  // namespace takt::pipeline
