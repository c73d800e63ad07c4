// SPDX-License-Identifier: Apache-2.0
#include "client/alternatives.hpp"

#include <algorithm>
#include <cmath>

#include "executive/contract/chunk_path.hpp"

namespace takt::client {

Alternatives::Alternatives(const config::RobotConfig& robot)
    : interpolation_(robot.policy->action.interpolation),
      max_age_(robot.freshness.max_age),
      joints_(robot.joints.size()) {
  const auto& tolerance = robot.policy->speculation;
  if (!tolerance) return;
  q_tolerance_ = static_cast<float>(tolerance->position);
  dq_tolerance_ = static_cast<float>(tolerance->velocity);
  for (const config::Joint& joint : robot.joints) per_rad_.push_back(static_cast<float>(config::per_rad(joint)));
  const std::size_t values = std::min(robot.policy->steps * joints_ * kCommandFieldCount, kMaxChunkValues);
  for (Kept& one : kept_) {
    one.values.resize(values);
    one.q.resize(joints_);
    one.dq.resize(joints_);
  }
}

void Alternatives::drop(Kept& one) {
  if (one.order != 0) ++counts_.dropped;
  one.order = 0;
}

void Alternatives::drop_all() {
  for (Kept& one : kept_) drop(one);
}

void Alternatives::keep(const CommandChunk& chunk, MonoTime sensed_at, const takt_assumption& assumption) {
  Kept& place = *std::ranges::min_element(kept_, {}, &Kept::order);  // a free one has order 0
  drop(place);
  ++counts_.kept;
  place.order = ++order_;
  place.header = chunk.header;
  place.at = {assumption.at_ns};
  place.sensed_at = sensed_at;
  place.has_dq = assumption.dq != nullptr;
  std::copy_n(chunk.values, chunk.value_count(), place.values.begin());
  std::copy_n(assumption.q, joints_, place.q.begin());
  if (place.has_dq) std::copy_n(assumption.dq, joints_, place.dq.begin());
}

// A distance of NaN matches nothing.
float Alternatives::distance(const Kept& one, const Observation& observation) const {
  float distance = 0.0F;
  const auto further = [&distance](float difference) {
    distance = std::isfinite(difference) ? std::max(distance, difference) : INFINITY;
  };
  for (std::size_t j = 0; j < joints_; ++j) {
    further(std::abs(one.q[j] - observation.q[j]) / (q_tolerance_ * per_rad_[j]));
    if (one.has_dq) further(std::abs(one.dq[j] - observation.dq[j]) / (dq_tolerance_ * per_rad_[j]));
  }
  return distance;
}

void Alternatives::read_from(const Kept& one, MonoTime from, CommandChunk& answer) const {
  const CommandHeader& header = one.header;
  const bool is_held = interpolation_ == config::Interpolation::hold;
  const bool is_cubic = interpolation_ == config::Interpolation::cubic;
  answer.header = header;
  for (std::size_t step = 0; step < header.step_count; ++step) {
    const Place place = place_of(header, from - one.at + header.step_period * static_cast<std::int64_t>(step), is_held);
    for (std::size_t joint = 0; joint < joints_; ++joint) {
      const auto at = [&](std::size_t k, CommandField field) {
        return one.values[value_index(header, field, k, joint)];
      };
      PathPoint point;
      if (is_cubic)
        point = cubic(at(place.step, CommandField::q), at(place.step, CommandField::dq),
                      at(place.next, CommandField::q), at(place.next, CommandField::dq), place);
      for (std::size_t bit = 0; bit < kCommandFieldCount; ++bit) {
        const auto field = static_cast<CommandField>(1U << bit);
        if ((header.fields & static_cast<unsigned>(field)) == 0) continue;
        float& value = answer.values[value_index(header, field, step, joint)];
        value = line(at(place.step, field), at(place.next, field), place).q;
        if (is_cubic && field == CommandField::q) value = point.q;
        if (is_cubic && field == CommandField::dq) value = point.dq;
      }
    }
  }
}

bool Alternatives::match(const Observation& observation, std::uint64_t answered, CommandChunk& answer,
                         MonoTime& sensed_at) {
  const MonoTime now = observation.published_at;
  Kept* nearest = nullptr;
  float nearest_distance = INFINITY;
  std::uint64_t compared = 0, matching = 0;
  for (Kept& one : kept_) {
    if (one.order == 0 || now < one.at) continue;
    const bool is_missed = now - one.at >= observation.period;
    if (is_missed || now - one.sensed_at > max_age_ || one.header.observation_id < answered) {
      drop(one);
      continue;
    }
    ++compared;
    const float far = distance(one, observation);
    if (far <= 1.0F) ++matching;
    if (far < nearest_distance) {
      nearest_distance = far;
      nearest = &one;
    }
  }
  counts_.unmatched += compared - matching;
  const bool is_taken = matching > 0;
  if (is_taken) {
    read_from(*nearest, now, answer);
    sensed_at = nearest->sensed_at;
    ++counts_.taken;
    counts_.outdone += matching - 1;
  }
  for (Kept& one : kept_)
    if (one.order != 0 && now >= one.at) one.order = 0;
  return is_taken;
}

}  // namespace takt::client
