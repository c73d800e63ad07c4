#include "policy_host/observation_builder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "config/observation_shape.hpp"

namespace takt::policy_host {
namespace {

using config::TermKind;

std::vector<float> to_float(const std::vector<double>& values) {
  std::vector<float> result(values.size());
  std::ranges::transform(values, result.begin(), [](double value) { return static_cast<float>(value); });
  return result;
}

std::array<float, 2> gait(Duration since, double period_s) {
  const double angle = 2 * std::numbers::pi * std::fmod(since.seconds(), period_s) / period_s;
  return {static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle))};
}

}  // namespace

ObservationBuilder::ObservationBuilder(const config::RobotConfig& robot) : joints_(robot.policy->joint_order) {
  if (joints_.empty()) {
    joints_.resize(robot.joints.size());
    std::iota(joints_.begin(), joints_.end(), std::size_t{0});
  }
  for (const config::Joint& joint : robot.joints) home_.push_back(static_cast<float>(joint.home));
  by_time_ = robot.policy->history_layout == "by_time";
  for (const config::ObservationTerm& described : robot.policy->observation) {
    Term term;
    term.kind = described.kind;
    term.width = config::term_width(robot, described);
    term.history = described.history;
    term.gait_period = std::max(described.gait_period, nanoseconds(1)).seconds();
    if (term.kind == TermKind::sensor || term.kind == TermKind::command) {
      const auto sensor = std::ranges::find(robot.sensors, described.sensor, &config::Sensor::name);
      term.sensor = static_cast<std::size_t>(sensor - robot.sensors.begin());
    }
    term.scale = to_float(described.scale);
    term.scale.resize(term.width, term.scale.front());
    term.constant = to_float(described.constant);
    term.past.resize(term.history * term.width);
    input_size_ += term.past.size();
    newest_.resize(std::max(newest_.size(), term.width));
    terms_.push_back(std::move(term));
  }
  input_.resize(input_size_);
}

void ObservationBuilder::reset() {
  began_at_ = {};
  for (Term& term : terms_) {
    term.filled = false;
    term.sample_seen = 0;
  }
}

void ObservationBuilder::read(const Term& term, const Observation& observation, std::span<const SensorSample> samples,
                              std::span<const float> last_action) {
  for (std::size_t i = 0; i < term.width; ++i) {
    float value = 0.0F;
    switch (term.kind) {
      case TermKind::joint_position_relative:
        value = observation.q[joints_[i]] - home_[joints_[i]];
        break;
      case TermKind::joint_position:
        value = observation.q[joints_[i]];
        break;
      case TermKind::joint_velocity:
        value = observation.dq[joints_[i]];
        break;
      case TermKind::sensor:
      case TermKind::command:
        value = samples[term.sensor].values[i];
        break;
      case TermKind::last_action:
        value = last_action[i];
        break;
      case TermKind::constant:
        value = term.constant[i];
        break;
      case TermKind::base_angular_velocity:
        value = observation.imu.angular_velocity[i];
        break;
      case TermKind::projected_gravity:
        value = projected_gravity(observation.imu)[i];
        break;
      case TermKind::gait_phase:
        value = gait(observation.published_at - began_at_, term.gait_period)[i];
        break;
    }
    newest_[i] = term.scale[i] * value;
  }
}

void ObservationBuilder::remember(Term& term, std::span<const float> newest) {
  const auto width = static_cast<std::ptrdiff_t>(term.width);
  if (!term.filled) {
    for (auto slot = term.past.begin(); slot != term.past.end(); slot += width) std::ranges::copy(newest, slot);
    term.filled = true;
    return;
  }
  std::copy(term.past.begin() + width, term.past.end(), term.past.begin());
  std::ranges::copy(newest, term.past.end() - width);
}

std::span<const float> ObservationBuilder::build(const Observation& observation, std::span<const SensorSample> samples,
                                                 std::span<const float> last_action) {
  if (!began_at_.is_set()) began_at_ = observation.published_at;
  for (Term& term : terms_) {
    if (term.kind == TermKind::sensor) {
      const std::uint64_t sequence = samples[term.sensor].sequence;
      if (term.filled && sequence == term.sample_seen) continue;
      term.sample_seen = sequence;
    }
    read(term, observation, samples, last_action);
    remember(term, std::span(newest_).first(term.width));
  }
  auto out = input_.begin();
  if (!by_time_) {
    for (const Term& term : terms_) out = std::ranges::copy(term.past, out).out;
    return input_;
  }
  for (std::size_t instant = 0; instant < terms_.front().history; ++instant) {
    for (const Term& term : terms_) {
      out = std::ranges::copy(std::span(term.past).subspan(instant * term.width, term.width), out).out;
    }
  }
  return input_;
}

}  // namespace takt::policy_host
