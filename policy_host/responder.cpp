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
      output_size_(policy.output_size()) {}

void Responder::start_session() {
  forget();
  ++session_;
  sequence_ = taken_sequence_ = 0;
  continuity_.start_session();
}

void Responder::forget() {
  input_.reset();
  last_action_.forget();
  ++times_forgotten_;
  forgot_ = true;
}

const CommandChunk& Responder::answer(const Observation& observation, std::span<const SensorSample> samples,
                                      MonoTime dequeued_at, Clock clock) {
  ask(observation, samples, dequeued_at, only_);
  infer(policy_, only_, clock);
  return *take(only_, clock);
}

void Responder::ask(const Observation& observation, std::span<const SensorSample> samples, MonoTime dequeued_at,
                    Request& request) {
  const auto [continues, dropped] = continuity_.advance(observation);
  if (!continues) forget();
  request.observation = observation;
  request.dequeued_at = dequeued_at;
  request.outside_sensed_at = {};
  for (const std::size_t sensor : sensors_) {
    const MonoTime sensed = samples[sensor].sensed_at;
    if (!request.outside_sensed_at.is_set() || sensed < request.outside_sensed_at) request.outside_sensed_at = sensed;
  }
  request.session = session_;
  request.sequence = ++sequence_;
  request.dropped = dropped;
  request.times_forgotten = times_forgotten_;
  request.after_reset = std::exchange(forgot_, false);
  const auto last_action = last_action_.due_at(observation.published_at);
  const auto input = input_.build(observation, samples, last_action);
  request.input.assign(input.begin(), input.end());
  request.output.resize(output_size_);
}

void Responder::infer(Policy& policy, Request& request, Clock clock) {
  if (request.after_reset) policy.reset();
  request.infer_started_at = clock();
  trace::infer_begin(request.observation.id, request.sequence, request.infer_started_at);
  policy.infer(request.input, request.output);
  request.infer_ended_at = clock();
  trace::infer_end(request.observation.id, request.sequence, request.infer_ended_at);
}

const CommandChunk* Responder::take(const Request& request, Clock clock) {
  if (request.session != session_ || request.sequence < taken_sequence_) return nullptr;
  taken_sequence_ = request.sequence;
  inference_ = {request.input, request.output, inference_.number + 1, request.after_reset};
  chunk_builder_.fill(chunk_, request.observation, request.output);
  if (request.times_forgotten == times_forgotten_) last_action_.remember(request.observation, request.output);
  // The executive refuses and names such a chunk; what must not happen is that it stays in the policy's memory.
  if (!std::ranges::all_of(request.output, [](float value) { return std::isfinite(value); })) forget();

  CommandHeader& header = chunk_.header;
  header.sequence = request.sequence;
  header.dropped_observations = static_cast<std::uint32_t>(std::min<std::uint64_t>(request.dropped, UINT32_MAX));
  header.outside_sensed_at = request.outside_sensed_at;
  header.dequeued_at = request.dequeued_at;
  header.infer_started_at = request.infer_started_at;
  header.infer_ended_at = request.infer_ended_at;
  header.published_at = clock();
  return &chunk_;
}

}  // namespace takt::policy_host
