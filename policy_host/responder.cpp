// SPDX-License-Identifier: Apache-2.0
#include "policy_host/responder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/observation_shape.hpp"
#include "executive/trace/trace.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host {

Responder::Responder(const config::RobotConfig& robot, std::uint64_t policy_hash, Policy& policy, PathOwner owner)
    : policy_(policy),
      input_(robot),
      chunk_builder_(robot, policy_hash),
      mixer_(robot, owner),
      last_action_(*robot.policy, config::outputs_per_step(robot)),
      step_period_(robot.policy->step_period),
      steps_(robot.policy->steps),
      sensors_(sensors_in_use(robot)),
      output_size_(policy.output_size()) {
  if (!robot.policy->sampler) return;
  flow_.emplace(robot, owner);
  prefix_ = robot.policy->sampler->prefix;
  draws_on_path_ =
      prefix_ != config::PrefixUse::none || robot.policy->sampler->choice == config::SampleChoice::coherent;
}

void Responder::start_session() {
  forget();
  ++session_;
  sequence_ = taken_sequence_ = 0;
  continuity_.start_session();
  dropped_late_ = false;
  if (flow_) flow_->start_session();
}

void Responder::forget() {
  input_.reset();
  last_action_.forget();
  mixer_.forget();
  ++times_forgotten_;
  forgot_ = true;
}

const CommandChunk& Responder::answer(const Observation& observation, std::span<const SensorSample> samples,
                                      MonoTime dequeued_at, Clock clock, Images images) {
  ask(observation, samples, dequeued_at, only_, images);
  infer(policy_, only_, clock);
  return *take(only_, clock);
}

bool Responder::awaits(const Observation& observation) const {
  return draws_on_path_ && flow_->awaits(observation);
}

bool Responder::continues_in_time(const Request& request) {
  if (prefix_ != config::PrefixUse::trained) return true;
  const std::size_t kept = FlowContext::read(std::span(request.input).subspan(input_.input_size()), steps_).kept();
  const Duration taken = request.infer_ended_at - request.observation.published_at;
  const bool late = kept > 0 && taken > step_period_ * static_cast<std::int64_t>(kept);
  dropped_late_ = late && !dropped_late_;
  return !dropped_late_;
}

void Responder::ask(const Observation& observation, std::span<const SensorSample> samples, MonoTime dequeued_at,
                    Request& request, Images images) {
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
  const auto input = input_.build(observation, samples, last_action, images);
  request.input.assign(input.begin(), input.end());
  const auto seen = input_.seen_images();
  request.images.assign(seen.begin(), seen.end());
  if (flow_) {
    request.input.resize(policy_.input_size());
    flow_->show(observation, std::span(request.input).subspan(input.size()));
  }
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
  if (request.session != session_ || request.sequence < taken_sequence_ || !continues_in_time(request)) return nullptr;
  taken_sequence_ = request.sequence;
  inference_ = {request.input, request.output, request.images, inference_.number + 1, request.after_reset};
  chunk_builder_.fill(chunk_, request.observation, request.output);
  const std::span<const float> said = request.output;
  const std::span meant = said.first(said.size() / steps_ * chunk_.header.step_count);
  if (request.times_forgotten == times_forgotten_) last_action_.remember(request.observation, meant);
  if (flow_) flow_->remember(request.sequence, request.observation, meant);
  // The executive refuses and names such a chunk; what must not happen is that it stays in the policy's memory.
  if (!std::ranges::all_of(meant, [](float value) { return std::isfinite(value); })) forget();

  CommandHeader& header = chunk_.header;
  header.sequence = request.sequence;
  header.dropped_observations = static_cast<std::uint32_t>(std::min<std::uint64_t>(request.dropped, UINT32_MAX));
  header.outside_sensed_at = request.outside_sensed_at;
  header.dequeued_at = request.dequeued_at;
  header.infer_started_at = request.infer_started_at;
  header.infer_ended_at = request.infer_ended_at;
  header.published_at = clock();
  mixer_.mix(request.observation, header.published_at, chunk_);
  return &chunk_;
}

}  // namespace takt::policy_host
