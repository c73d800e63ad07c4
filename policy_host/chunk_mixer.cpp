// SPDX-License-Identifier: Apache-2.0
#include "policy_host/chunk_mixer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

namespace takt::policy_host {
namespace {

float share(Duration part, Duration whole) {
  return std::clamp(static_cast<float>(part.ns) / static_cast<float>(whole.ns), 0.0F, 1.0F);
}

// What is left of the difference `since` the instant that it was taken at. 0 <= since.
PathPoint remainder_after(const PathPoint& at_join, Duration since, const config::Join& join) {
  if (since >= join.over) return {};
  const float span = static_cast<float>(join.over.ns) * 1.0e-9F;
  const float s = share(since, join.over);
  if (join.kind == config::JoinKind::align) return {at_join.q * (1.0F - s), -at_join.q / span, 0.0F};
  const float c0 = at_join.q, c1 = at_join.dq * span, c2 = 0.5F * at_join.ddq * span * span;
  const float c3 = -10.0F * c0 - 6.0F * c1 - 3.0F * c2;
  const float c4 = 15.0F * c0 + 8.0F * c1 + 3.0F * c2;
  const float c5 = -6.0F * c0 - 3.0F * c1 - c2;
  return {c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
          (c1 + s * (2.0F * c2 + s * (3.0F * c3 + s * (4.0F * c4 + s * 5.0F * c5)))) / span, 0.0F};
}

std::size_t rank_of(CommandField field) {
  return static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(field)));
}

bool has(const CommandHeader& header, CommandField field) {
  return (header.fields & static_cast<unsigned>(field)) != 0;
}

}  // namespace

bool mixes_answers(config::JoinKind kind) {
  switch (kind) {
    case config::JoinKind::blend:
    case config::JoinKind::ensemble:
    case config::JoinKind::align:
    case config::JoinKind::quintic:
      return true;
    case config::JoinKind::replace:
    case config::JoinKind::cross_fade:
    case config::JoinKind::prefix:
      return false;
  }
  return false;
}

ChunkMixer::ChunkMixer(const config::RobotConfig& robot, PathOwner owner)
    : join_(robot.policy->action.join),
      owner_(owner),
      is_held_(robot.policy->action.interpolation == config::Interpolation::hold),
      is_cubic_(robot.policy->action.interpolation == config::Interpolation::cubic),
      decay_(static_cast<float>(std::exp(-join_.decay))) {
  header_.step_count = 0;
  if (!mixes_answers(join_.kind)) return;
  for (const config::Joint& joint : robot.joints) {
    const config::Limits& limits = joint.limits;
    const auto narrow = [](double value) { return static_cast<float>(value); };
    const float velocity = narrow(limits.velocity), torque = narrow(limits.torque);
    ranges_.push_back({Range{narrow(limits.q_min - limits.target_margin), narrow(limits.q_max + limits.target_margin)},
                       Range{-velocity, velocity}, Range{0.0F, narrow(limits.kp)}, Range{0.0F, narrow(limits.kd)},
                       Range{-torque, torque}});
  }
  values_.resize(
      std::min<std::size_t>(robot.policy->steps * robot.joints.size() * kCommandFieldCount, kMaxChunkValues));
  weights_.resize(robot.policy->steps);
  weights_before_.resize(robot.policy->steps);
}

bool ChunkMixer::is_played(const Observation& observation) const {
  if (owner_ == PathOwner::nobody) return true;
  return observation.command_sequence != 0 && (observation.of_candidate != 0) == (owner_ == PathOwner::candidate);
}

float ChunkMixer::old_at(std::size_t step, CommandField field, std::size_t joint) const {
  const Range range = ranges_[joint][rank_of(field)];
  return std::clamp(values_[value_index(header_, field, step, joint)], range.low, range.high);
}

PathPoint ChunkMixer::old_position(const Place& place, std::size_t joint) const {
  const float q0 = old_at(place.step, CommandField::q, joint), q1 = old_at(place.next, CommandField::q, joint);
  if (!is_cubic_) return line(q0, q1, place);
  return cubic(q0, old_at(place.step, CommandField::dq, joint), q1, old_at(place.next, CommandField::dq, joint), place);
}

PathPoint ChunkMixer::position(const CommandChunk& chunk, const Place& place, std::size_t joint) const {
  const auto at = [&](std::size_t step, CommandField field) {
    return chunk.values[value_index(chunk.header, field, step, joint)];
  };
  const float q0 = at(place.step, CommandField::q), q1 = at(place.next, CommandField::q);
  if (!is_cubic_) return line(q0, q1, place);
  return cubic(q0, at(place.step, CommandField::dq), q1, at(place.next, CommandField::dq), place);
}

float ChunkMixer::share_of_new(std::size_t step, MonoTime due, const Place& place) {
  const MonoTime ends = begins_ + header_.step_period * header_.step_count;
  if (due >= ends) {
    weights_[step] = {1.0F, 1.0F};
    return 1.0F;
  }
  if (join_.kind == config::JoinKind::blend) return static_cast<float>(join_.new_share);
  const Weight before = weights_before_[place.step];
  const float left = join_.taper > Duration{} ? share(ends - due, join_.taper) : 1.0F;
  const float newest = before.newest * decay_;
  const float total = before.total * left + newest;
  weights_[step] = {total, newest};
  return total > 0.0F ? newest / total : 1.0F;
}

void ChunkMixer::mix_step(std::size_t step, const Place& place, float share, CommandChunk& answer) const {
  const CommandHeader& header = answer.header;
  for (std::size_t joint = 0; joint < header.joint_count; ++joint) {
    const PathPoint was = old_position(place, joint);
    for (std::size_t bit = 0; bit < kCommandFieldCount; ++bit) {
      const auto field = static_cast<CommandField>(1U << bit);
      if (!has(header, field)) continue;
      const float from = old_at(place.step, field, joint);
      float before = from + (old_at(place.next, field, joint) - from) * place.fraction;
      if (field == CommandField::q) before = was.q;
      if (field == CommandField::dq && is_cubic_) before = was.dq;
      float& value = answer.values[value_index(header, field, step, joint)];
      if (share < 1.0F) value = before + share * (value - before);
    }
  }
}

void ChunkMixer::mix_steps(MonoTime begins, CommandChunk& answer) {
  std::swap(weights_, weights_before_);
  for (std::size_t step = 0; step < answer.header.step_count; ++step) {
    const MonoTime due = begins + answer.header.step_period * static_cast<std::int64_t>(step);
    const Place place = place_of(header_, due - begins_, is_held_);
    mix_step(step, place, share_of_new(step, due, place), answer);
  }
}

void ChunkMixer::fade_difference(MonoTime begins, MonoTime now, CommandChunk& answer) const {
  const CommandHeader& header = answer.header;
  const Place old_place = place_of(header_, now - begins_, is_held_), place = place_of(header, now - begins, is_held_);
  for (std::size_t joint = 0; joint < header.joint_count; ++joint) {
    const PathPoint difference = old_position(old_place, joint) - position(answer, place, joint);
    for (std::size_t step = 0; step < header.step_count; ++step) {
      const MonoTime due = begins + header.step_period * static_cast<std::int64_t>(step);
      const PathPoint left = remainder_after(difference, std::max(due - now, Duration{}), join_);
      answer.values[value_index(header, CommandField::q, step, joint)] += left.q;
      if (is_cubic_) answer.values[value_index(header, CommandField::dq, step, joint)] += left.dq;
    }
  }
}

void ChunkMixer::remember(MonoTime begins, const CommandChunk& answer) {
  const std::span<const float> values(answer.values, answer.value_count());
  if (values.size() > values_.size() || answer.header.step_count > weights_.size() ||
      !std::ranges::all_of(values, [](float value) { return std::isfinite(value); }))
    return forget();
  header_ = answer.header;
  begins_ = begins;
  std::ranges::copy(values, values_.begin());
}

void ChunkMixer::mix(const Observation& observation, MonoTime now, CommandChunk& answer) {
  if (!mixes_answers(join_.kind) || answer.header.joint_count != ranges_.size()) return;
  const CommandHeader& header = answer.header;
  const MonoTime begins = observation.published_at;
  const bool is_alike = header_.step_count > 0 && header_.fields == header.fields &&
                        header_.step_period == header.step_period && begins_ <= begins &&
                        header.step_count <= weights_.size();
  const bool has_old = is_alike && now < begins_ + header_.step_period * header_.step_count && is_played(observation);
  if (!has_old)
    std::ranges::fill(weights_, Weight{1.0F, 1.0F});
  else if (join_.kind == config::JoinKind::blend || join_.kind == config::JoinKind::ensemble)
    mix_steps(begins, answer);
  else
    fade_difference(begins, now, answer);
  remember(begins, answer);
}

}  // namespace takt::policy_host
