#include "policy_host/responder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/observation_shape.hpp"
#include "executive/trace/trace.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host {

Responder::Responder(const config::RobotConfig& robot, std::uint64_t policy_hash, Policy& policy)
    : policy_(policy),
      input_(robot),
      chunk_builder_(robot, policy_hash),
      last_action_(*robot.policy, config::outputs_per_step(robot)),
      sensors_(sensors_in_use(robot)),
      output_(policy.output_size()) {}

void Responder::start_session() {
  forget();
  sequence_ = 0;
  continuity_.start_session();
}

void Responder::forget() {
  input_.reset();
  last_action_.forget();
  policy_.reset();
  forgot_ = true;
}

const CommandChunk& Responder::answer(const Observation& observation, std::span<const SensorSample> samples,
                                      MonoTime dequeued_at, Clock clock) {
  const auto [continues, dropped] = continuity_.advance(observation);
  if (!continues) forget();

  const auto last_action = last_action_.due_at(observation.published_at);
  const std::uint64_t sequence = ++sequence_;
  const MonoTime started = clock();
  trace::infer_begin(observation.id, sequence, started);
  inference_ = {input_.build(observation, samples, last_action), output_, inference_.number + 1,
                std::exchange(forgot_, false)};
  policy_.infer(inference_.input, output_);
  const MonoTime ended = clock();
  trace::infer_end(observation.id, sequence, ended);
  chunk_builder_.fill(chunk_, observation, output_);
  last_action_.remember(observation, output_);
  // The executive refuses and names such a chunk; what must not happen is that it stays in the policy's memory.
  if (!std::ranges::all_of(output_, [](float value) { return std::isfinite(value); })) forget();

  CommandHeader& header = chunk_.header;
  header.sequence = sequence;
  header.dropped_observations = static_cast<std::uint32_t>(std::min<std::uint64_t>(dropped, UINT32_MAX));
  for (const std::size_t sensor : sensors_) {
    const MonoTime sensed = samples[sensor].sensed_at;
    if (!header.outside_sensed_at.is_set() || sensed < header.outside_sensed_at) header.outside_sensed_at = sensed;
  }
  header.dequeued_at = dequeued_at;
  header.infer_started_at = started;
  header.infer_ended_at = ended;
  header.published_at = clock();
  return chunk_;
}

}  // namespace takt::policy_host
