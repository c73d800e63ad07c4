// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/join.hpp"

#include <algorithm>

namespace takt::pipeline {
namespace {

void copy_used(CommandChunk& to, const CommandChunk& from) {
  to.header = from.header;
  std::copy_n(from.values, from.value_count(), to.values);
}

float share(Duration part, Duration whole) {
  return std::clamp(static_cast<float>(part.ns) / static_cast<float>(whole.ns), 0.0F, 1.0F);
}

// How much of one step is the new chunk's.
struct Mixture {
  float next;  // 0..1
  float rate;  // 1/s, how fast that rises
};

// Mixes a new chunk into the path, in place: a step of it stands never after the path's step for the same instant.
class Mixer {
 public:
  Mixer(CommandChunk& path, MonoTime path_begins, const Timed& next, MonoTime now, const TickConfig& config)
      : path_(path), next_(next), now_(now), config_(config), old_(path.header) {
    ahead_ = next.begins - path_begins;
    path_ends_ = path_begins + old_.step_period * old_.step_count;
  }

  void run() {
    const CommandHeader& header = next_.chunk.header;
    for (std::size_t step = 0; step < header.step_count; ++step) {
      const MonoTime due = next_.begins + header.step_period * static_cast<std::int64_t>(step);
      place_ = place_of(old_, due - next_.begins + ahead_, config_.interpolation);
      const Mixture mixture = due >= path_ends_ ? Mixture{1.0F, 0.0F} : mixture_at(due);
      for (std::size_t joint = 0; joint < config_.joint_count; ++joint) mix(step, joint, mixture);
    }
    path_.header = header;
  }

 private:
  [[nodiscard]] Mixture mixture_at(MonoTime due) const {
    const Duration over = config_.join.over, since = due - now_;
    const bool rising = since > Duration{} && since < over;
    return {share(since, over), rising ? 1.0e9F / static_cast<float>(over.ns) : 0.0F};
  }

  // In its joint's range: what one answer asked for beyond it would pull at the answers after it.
  [[nodiscard]] float old_at(std::size_t step, CommandField field, std::size_t joint) const {
    const Range range = range_of(field, config_.joints[joint].limits);
    return std::clamp(path_.values[value_index(old_, field, step, joint)], range.low, range.high);
  }
  [[nodiscard]] PathPoint old_position(std::size_t joint) const {
    const float q0 = old_at(place_.step, CommandField::q, joint), q1 = old_at(place_.next, CommandField::q, joint);
    if (config_.interpolation != Interpolation::cubic) return line(q0, q1, place_);
    return cubic(q0, old_at(place_.step, CommandField::dq, joint), q1, old_at(place_.next, CommandField::dq, joint),
                 place_);
  }

  void mix(std::size_t step, std::size_t joint, const Mixture& mixture) {
    const CommandHeader& header = next_.chunk.header;
    const PathPoint was = old_position(joint);
    const bool cubic_path = config_.interpolation == Interpolation::cubic;
    const float q_next = next_.chunk.values[value_index(header, CommandField::q, step, joint)];
    for (std::size_t bit = 0; bit < kCommandFieldCount; ++bit) {
      const auto field = static_cast<CommandField>(1U << bit);
      if ((header.fields & static_cast<unsigned>(field)) == 0) continue;
      const std::size_t index = value_index(header, field, step, joint);
      const float from = old_at(place_.step, field, joint);
      float before = from + (old_at(place_.next, field, joint) - from) * place_.fraction;
      float slope = 0.0F;
      if (field == CommandField::q) before = was.q;
      if (field == CommandField::dq && cubic_path) {
        before = was.dq;
        slope = mixture.rate * (q_next - was.q);
      }
      const float next = next_.chunk.values[index];
      mixed_[bit] = mixture.next >= 1.0F ? next : before + mixture.next * (next - before) + slope;
    }
    for (std::size_t bit = 0; bit < kCommandFieldCount; ++bit) {
      const auto field = static_cast<CommandField>(1U << bit);
      if ((header.fields & static_cast<unsigned>(field)) != 0)
        path_.values[value_index(header, field, step, joint)] = mixed_[bit];
    }
  }

  CommandChunk& path_;
  const Timed& next_;
  MonoTime now_;
  const TickConfig& config_;
  const CommandHeader old_;
  Duration ahead_;  // of the new chunk's first step over the path's
  MonoTime path_ends_;
  Place place_;
  std::array<float, kCommandFieldCount> mixed_{};
};

}  // namespace

Duration DelayMemory::longest(MonoTime now) const {
  Duration longest;
  for (const Noted& one : noted_)
    if (one.at.is_set() && now - one.at <= kDelayMemory) longest = std::max(longest, one.delay);
  return longest;
}

PathPoint remainder_after(const PathPoint& at_join, Duration since, const JoinRule& rule) {
  if (since >= rule.over) return {};
  const float span = static_cast<float>(rule.over.ns) * 1.0e-9F;
  return {at_join.q * (1.0F - share(since, rule.over)), -at_join.q / span, 0.0F};
}

PathPoint path_at(const JoinState& state, const Timed& path, MonoTime now, std::size_t joint,
                  const TickConfig& config) {
  const Place place = place_of(path.chunk.header, now - path.begins, config.interpolation);
  const PathPoint steps =
      PathReader(path.chunk, place, joint, config.joints[joint].limits).position(config.interpolation);
  if (!state.joined_at.is_set()) return steps;
  return steps + remainder_after(state.remainder[joint], now - state.joined_at, config.join);
}

void begin_path(JoinState& state, CommandChunk& path, const CommandChunk& next) {
  copy_used(path, next);
  state.joined_at = {};
}

void join_references(JoinState& state, const Timed& path, std::span<const PathPoint> references, MonoTime now,
                     const TickConfig& config) {
  state.joined_at = {};
  if (config.join.kind != JoinKind::cross_fade) return;
  for (std::size_t j = 0; j < references.size(); ++j)
    state.remainder[j] = references[j] - path_at(state, path, now, j, config);
  state.joined_at = now;
}

void join_path(JoinState& state, CommandChunk& path, MonoTime path_begins, const Timed& next, MonoTime now,
               const TickConfig& config) {
  const CommandHeader &from = path.header, &to = next.chunk.header;
  const bool alike = from.fields == to.fields && from.step_period == to.step_period && path_begins <= next.begins;
  const bool remains = config.join.kind == JoinKind::cross_fade;
  std::array<PathPoint, kMaxJoints> before;
  for (std::size_t j = 0; remains && j < config.joint_count; ++j)
    before[j] = path_at(state, {path, path_begins}, now, j, config);
  if (remains && alike)
    Mixer(path, path_begins, next, now, config).run();
  else
    begin_path(state, path, next.chunk);
  state.joined_at = remains ? now : MonoTime{};
  for (std::size_t j = 0; remains && j < config.joint_count; ++j) {
    const Place place = place_of(path.header, now - next.begins, config.interpolation);
    state.remainder[j] = before[j] - PathReader(path, place, j, config.joints[j].limits).position(config.interpolation);
  }
}

}  // namespace takt::pipeline
