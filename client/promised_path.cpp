// SPDX-License-Identifier: Apache-2.0
#include "client/promised_path.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace takt::client {
namespace {

// Between two steps, `part` of the way; slopes in rad per step period.
float curve(float q0, float slope0, float q1, float slope1, float part) {
  const float rest = 1.0F - part;
  return rest * rest * ((1.0F + 2.0F * part) * q0 + part * slope0) +
         part * part * ((3.0F - 2.0F * part) * q1 - rest * slope1);
}

}  // namespace

PromisedPath::PromisedPath(const config::RobotConfig& robot)
    : interpolation_(robot.policy->action.interpolation),
      step_period_(robot.policy->step_period),
      steps_(robot.policy->steps),
      joints_(robot.joints.size()) {
  if (robot.policy->action.join.kind != config::JoinKind::prefix) return;
  published_.resize(kRemembered + 1);
  for (Published& chunk : published_) {
    chunk.q.resize(steps_ * joints_);
    if (interpolation_ == config::Interpolation::cubic) chunk.dq.resize(steps_ * joints_);
  }
  rows_.resize(steps_ * joints_);
}

void PromisedPath::start_session() {
  for (Published& chunk : published_) chunk.sequence = 0;
  followed_ = newest_ = 0;
}

void PromisedPath::remember(const Answer& answer, const CommandChunk& chunk) {
  const std::span<const float> values(chunk.values, chunk.value_count());
  if (published_.empty() || !std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) return;
  const auto needed = [this](const Published& one) {
    return one.sequence == followed_ && followed_ != 0 ? UINT64_MAX : one.sequence;
  };
  Published& place = *std::ranges::min_element(published_, {}, needed);
  static_cast<Answer&>(place) = answer;
  newest_ = answer.sequence;
  const auto copy = [&](CommandField field, std::vector<float>& to) {
    for (std::size_t step = 0; step < to.size() / joints_; ++step)
      std::copy_n(&chunk.values[value_index(chunk.header, field, step, 0)], joints_, &to[step * joints_]);
  };
  copy(CommandField::q, place.q);
  copy(CommandField::dq, place.dq);
}

// Null: it is not remembered.
const PromisedPath::Published* PromisedPath::played_after(const Observation& observation) const {
  const auto newest = std::ranges::find(published_, newest_, &Published::sequence);
  if (newest != published_.end() && newest_ > observation.command_sequence) {
    const bool is_late =
        newest->published_at.is_set() ? newest->published_at >= observation.published_at : observation.overtaken != 0;
    if (is_late) return &*newest;
  }
  const auto named = std::ranges::find(published_, observation.command_sequence, &Published::sequence);
  return named == published_.end() ? nullptr : &*named;
}

const float* PromisedPath::show(const Observation& observation) {
  followed_ = observation.command_sequence;
  if (followed_ == 0 || observation.committed_count == 0) return nullptr;
  const Published* const chunk = played_after(observation);
  if (chunk == nullptr) return nullptr;
  const Duration since = observation.published_at - chunk->begins;
  const std::size_t count = std::min<std::size_t>(observation.committed_count, steps_);
  for (std::size_t i = 0; i < count; ++i)
    show_row(*chunk, since + step_period_ * static_cast<std::int64_t>(i), &rows_[i * joints_]);
  return rows_.data();
}

void PromisedPath::show_row(const Published& chunk, Duration since, float* row) const {
  const bool is_held = interpolation_ == config::Interpolation::hold;
  const std::int64_t last = static_cast<std::int64_t>(steps_) - 1;
  const std::int64_t ns = std::max<std::int64_t>(since.ns, 0) + (is_held ? step_period_.ns / 2 : 0);
  const std::int64_t step = std::min(ns / step_period_.ns, last);
  const std::size_t here = static_cast<std::size_t>(step) * joints_;
  if (is_held || step == last) {
    std::copy_n(&chunk.q[here], joints_, row);
    return;
  }
  const auto part =
      static_cast<float>(static_cast<double>(ns - step * step_period_.ns) / static_cast<double>(step_period_.ns));
  const float span = static_cast<float>(step_period_.seconds());
  for (std::size_t joint = 0; joint < joints_; ++joint) {
    const std::size_t from = here + joint, to = from + joints_;
    row[joint] = chunk.dq.empty() ? chunk.q[from] + part * (chunk.q[to] - chunk.q[from])
                                  : curve(chunk.q[from], span * chunk.dq[from], chunk.q[to], span * chunk.dq[to], part);
  }
}

}  // namespace takt::client
