// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/chunk_scores.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "config/action_target.hpp"

namespace takt::monitor {
namespace {

using Step = std::vector<double>;

std::vector<Step> differences(const std::vector<Step>& path) {
  std::vector<Step> made;
  for (std::size_t k = 1; k < path.size(); ++k) {
    Step& step = made.emplace_back(path[k]);
    for (std::size_t joint = 0; joint < step.size(); ++joint) step[joint] -= path[k - 1][joint];
  }
  return made;
}

double squares(const std::vector<Step>& steps) {
  double sum = 0;
  for (const Step& step : steps) sum = std::inner_product(step.begin(), step.end(), step.begin(), sum);
  return sum;
}

double root_mean_square(const std::vector<Step>& steps) {
  if (steps.empty() || steps.front().empty()) return 0;
  return std::sqrt(squares(steps) / static_cast<double>(steps.size() * steps.front().size()));
}

double norm(const Step& step) {
  return std::sqrt(std::inner_product(step.begin(), step.end(), step.begin(), 0.0));
}

double largest(const Step& step) {
  return std::transform_reduce(
      step.begin(), step.end(), 0.0, [](double a, double b) { return std::max(a, b); },
      [](double value) { return std::abs(value); });
}

double reversals(const std::vector<Step>& moves) {
  std::size_t pairs = 0, turned = 0;
  for (std::size_t k = 1; k < moves.size(); ++k) {
    for (std::size_t joint = 0; joint < moves[k].size(); ++joint) {
      const double a = moves[k - 1][joint], b = moves[k][joint];
      ++pairs;
      if (a * b < 0 && std::min(std::abs(a), std::abs(b)) > ChunkScorer::kDeadband) ++turned;
    }
  }
  return pairs == 0 ? 0 : static_cast<double>(turned) / static_cast<double>(pairs);
}

double jerk(const std::vector<Step>& moves) {
  return root_mean_square(differences(differences(moves))) / (root_mean_square(moves) + ChunkScorer::kDeadband);
}

double inefficiency(const std::vector<Step>& path, const std::vector<Step>& moves) {
  double length = 0;
  for (const Step& move : moves) length += norm(move);
  if (length <= ChunkScorer::kDeadband * static_cast<double>(moves.size())) return 0;
  return 1 - norm(differences({path.front(), path.back()}).front()) / length;
}

double stall(const std::vector<Step>& moves) {
  const auto still =
      std::ranges::count_if(moves, [](const Step& move) { return largest(move) <= ChunkScorer::kDeadband; });
  return static_cast<double>(still) / static_cast<double>(moves.size());
}

double most_in_one_step(const config::Joint& joint, const config::Policy& policy) {
  double most = joint.limits.velocity;
  if (policy.action.kind == config::ActionKind::joint_position) most *= policy.step_period.seconds();
  if (policy.action.kind == config::ActionKind::joint_torque) most = joint.limits.torque;
  return most > 0 ? most : 1;  // a passive joint is never asked to do anything
}

}  // namespace

ChunkScorer::ChunkScorer(const config::RobotConfig& robot)
    : field_(config::target_of(robot.policy->action.kind).field) {
  for (const config::Joint& joint : robot.joints) unit_.push_back(most_in_one_step(joint, *robot.policy));
}

std::vector<Step> ChunkScorer::steps_of(const CommandChunk& chunk) const {
  std::vector<Step> steps(chunk.header.step_count, Step(unit_.size()));
  if ((chunk.header.fields & static_cast<unsigned>(field_)) == 0) return steps;
  for (std::size_t k = 0; k < steps.size(); ++k)
    for (std::size_t joint = 0; joint < unit_.size(); ++joint)
      steps[k][joint] = static_cast<double>(chunk.values[value_index(chunk.header, field_, k, joint)]) / unit_[joint];
  return steps;
}

double ChunkScorer::temporal_error(const std::vector<Step>& steps, MonoTime begins, Duration step_period) const {
  if (before_.empty()) return 0;
  std::vector<Step> apart;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const Duration since = begins + step_period * static_cast<std::int64_t>(k) - before_begins_;
    const double place = static_cast<double>(since.ns) / static_cast<double>(before_period_.ns);
    const auto last = static_cast<double>(before_.size() - 1);
    if (place < 0 || place > last) continue;
    const auto here = static_cast<std::size_t>(place);
    const std::size_t next = std::min(here + 1, before_.size() - 1);
    const double fraction = place - static_cast<double>(here);
    Step& difference = apart.emplace_back(steps[k]);
    for (std::size_t joint = 0; joint < difference.size(); ++joint)
      difference[joint] -= std::lerp(before_[here][joint], before_[next][joint], fraction);
  }
  return root_mean_square(apart);
}

ChunkScores ChunkScorer::score(const CommandChunk& chunk, MonoTime observed_at) {
  std::vector<Step> steps = steps_of(chunk);
  ChunkScores scores{};
  const auto put = [&scores](config::ChunkScore score, double value) {
    scores[static_cast<std::size_t>(score)] = value;
  };
  put(config::ChunkScore::temporal_error, temporal_error(steps, observed_at, chunk.header.step_period));

  first_steps_.push_back(steps.front());
  if (first_steps_.size() > kAnswers) first_steps_.pop_front();
  const std::vector<Step> path =
      steps.size() >= kPathSteps ? steps : std::vector<Step>(first_steps_.begin(), first_steps_.end());
  if (path.size() >= kPathSteps) {
    const std::vector<Step> moves = differences(path);
    put(config::ChunkScore::reversals, reversals(moves));
    put(config::ChunkScore::jerk, jerk(moves));
    put(config::ChunkScore::inefficiency, inefficiency(path, moves));
    put(config::ChunkScore::stall, stall(moves));
    put(config::ChunkScore::velocity, largest(*std::ranges::max_element(moves, {}, largest)));
  }
  before_ = std::move(steps);
  before_begins_ = observed_at;
  before_period_ = chunk.header.step_period;
  return scores;
}

}  // namespace takt::monitor
