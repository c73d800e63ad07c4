// SPDX-License-Identifier: Apache-2.0
#include "policy_host/flow/flow_context.hpp"

#include <algorithm>

#include "config/observation_shape.hpp"

namespace takt::policy_host {
namespace {

constexpr unsigned kDigitBits = 24;  // every whole number below 2^24 is exact in a float
constexpr std::uint64_t kDigit = (std::uint64_t{1} << kDigitBits) - 1;

// A count as a float has it; not a number and what is below 0 is 0.
std::uint64_t count_of(float value, std::uint64_t most) {
  if (!(value >= 1.0F)) return 0;
  return value < static_cast<float>(most) ? static_cast<std::uint64_t>(value) : most;
}

}  // namespace

FlowContext FlowContext::read(std::span<const float> values, std::size_t steps) {
  FlowContext context;
  for (unsigned digit = 0; digit < 3; ++digit)
    context.observation_id |= count_of(values[digit], kDigit) << (digit * kDigitBits);
  context.known = count_of(values[4], steps);
  context.promised = count_of(values[3], context.known);
  context.path = values.subspan(kCounts);
  return context;
}

FlowMemory::FlowMemory(const config::RobotConfig& robot, PathOwner owner)
    : owner_(owner),
      step_period_(robot.policy->step_period),
      held_(robot.policy->action.interpolation == config::Interpolation::hold),
      measured_(robot.policy->action.offset == config::OffsetKind::measured),
      steps_(robot.policy->steps),
      width_(config::outputs_per_step(robot)),
      answers_(kRemembered) {
  const config::Action& action = robot.policy->action;
  for (std::size_t i = 0; i < width_; ++i)
    outputs_.push_back({action.joint_of_output.empty() ? i : action.joint_of_output[i],
                        static_cast<float>(action.scale.size() == 1 ? action.scale.front() : action.scale[i])});
  for (Answer& answer : answers_) answer.outputs.resize(steps_ * width_);
}

void FlowMemory::start_session() {
  for (Answer& answer : answers_) answer.sequence = 0;
  newest_ = 0;
}

void FlowMemory::remember(std::uint64_t sequence, const Observation& answered, std::span<const float> outputs) {
  Answer& answer = answers_[sequence % kRemembered];
  answer.sequence = newest_ = sequence;
  answer.begins = answered.published_at;
  std::ranges::copy(answered.q.at, answer.measured.begin());
  std::ranges::copy(outputs, answer.outputs.begin());
  answer.steps = outputs.size() / width_;
}

bool FlowMemory::speaks_of_us(const Observation& observation) const {
  return owner_ != PathOwner::nobody && (observation.of_candidate != 0) == (owner_ == PathOwner::candidate);
}

const FlowMemory::Answer* FlowMemory::played(const Observation& observation) const {
  if (!speaks_of_us(observation) || observation.command_sequence == 0) return nullptr;
  const Answer& answer = answers_[observation.command_sequence % kRemembered];
  return answer.sequence == observation.command_sequence ? &answer : nullptr;
}

// The same target, said in relation to where the joint is now.
float FlowMemory::moved(const Answer& answer, const Observation& observation, std::size_t output) const {
  const auto [joint, scale] = outputs_[output];
  return measured_ && scale != 0.0F ? (answer.measured[joint] - observation.q[joint]) / scale : 0.0F;
}

void FlowMemory::show(const Observation& observation, std::span<float> values) const {
  std::ranges::fill(values, 0.0F);
  for (unsigned digit = 0; digit < 3; ++digit)
    values[digit] = static_cast<float>((observation.id >> (digit * kDigitBits)) & kDigit);
  const Answer* const answer = played(observation);
  if (answer == nullptr) return;
  const Duration since = observation.published_at - answer->begins;
  const auto steps = static_cast<std::int64_t>(answer->steps);
  // Of held steps the one that is played for most of the new chunk's first: clocks jitter, and a step that ends 30 us
  // from now is not what the new chunk begins with.
  const std::int64_t at_ns = since.ns + (held_ ? step_period_.ns / 2 : 0);
  const std::int64_t first = std::clamp<std::int64_t>(at_ns / step_period_.ns, 0, steps);
  const auto known = static_cast<std::size_t>(steps - first);
  if (known == 0) return;
  values[3] = static_cast<float>(std::min<std::size_t>(observation.committed_count, known));
  values[4] = static_cast<float>(known);
  const float between =
      held_ ? 0.0F : static_cast<float>(since.ns - first * step_period_.ns) / static_cast<float>(step_period_.ns);
  for (std::size_t step = 0; step < steps_; ++step) {
    const std::size_t at = std::min(static_cast<std::size_t>(first) + step, answer->steps - 1);
    const std::size_t next = std::min(at + 1, answer->steps - 1);
    for (std::size_t i = 0; i < width_; ++i) {
      const float from = answer->outputs[at * width_ + i], to = answer->outputs[next * width_ + i];
      values[FlowContext::kCounts + step * width_ + i] = from + between * (to - from) + moved(*answer, observation, i);
    }
  }
}

bool FlowMemory::awaits(const Observation& observation) const {
  if (newest_ == 0 || !speaks_of_us(observation) || observation.command_sequence == newest_) return false;
  const Answer& answer = answers_[newest_ % kRemembered];
  return observation.published_at < answer.begins + step_period_ * static_cast<std::int64_t>(answer.steps);
}

}  // namespace takt::policy_host
