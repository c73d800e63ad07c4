// SPDX-License-Identifier: Apache-2.0
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

// One for all, or one each; `otherwise` where none is given.
std::vector<float> one_each(const std::vector<double>& given, std::size_t count, float otherwise) {
  std::vector<float> values = to_float(given);
  values.resize(count, values.empty() ? otherwise : values.front());
  return values;
}

constexpr std::size_t kByteValues = 256;
constexpr float kLargestByte = 255;

std::array<float, 2> gait(Duration since, double period_s) {
  const double angle = 2 * std::numbers::pi * std::fmod(since.seconds(), period_s) / period_s;
  return {static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle))};
}

}  // namespace

ObservationBuilder::ObservationBuilder(const config::RobotConfig& robot) {
  std::vector<std::size_t> joints = robot.policy->joint_order;
  if (joints.empty()) {
    joints.resize(robot.joints.size());
    std::iota(joints.begin(), joints.end(), std::size_t{0});
  }
  for (const config::Joint& joint : robot.joints) home_.push_back(static_cast<float>(joint.home));
  by_time_ = robot.policy->history_layout == "by_time";
  newest_first_ = robot.policy->history_order == "newest_first";
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
    term.joints = described.joints.empty() ? joints : described.joints;
    term.xyzw = described.order == config::QuaternionOrder::xyzw;
    term.low = described.clip.empty() ? -HUGE_VALF : static_cast<float>(described.clip.front());
    term.high = described.clip.empty() ? HUGE_VALF : static_cast<float>(described.clip.back());
    const std::size_t scales = config::scales_of(robot, described);
    term.scale = one_each(described.scale, scales, 1);
    term.mean = one_each(described.mean, scales, 0);
    term.standard_deviation = one_each(described.standard_deviation, scales, 1);
    if (const config::ImageShape* const image = config::image_of(robot, described)) {
      term.channels = image->channels;
      term.by_channel = described.layout == config::ImageLayout::chw;
      for (std::size_t i = 0; i < kByteValues * term.channels; ++i)
        term.of_byte.push_back(scaled(term, i / kByteValues, static_cast<float>(i % kByteValues) / kLargestByte));
    }
    term.constant = to_float(described.constant);
    term.past.resize(term.history * term.width);
    if (term.channels != 0) term.seen.resize(term.history);
    input_size_ += term.past.size();
    newest_.resize(std::max(newest_.size(), term.width));
    terms_.push_back(std::move(term));
  }
  input_.resize(input_size_);
  place_images();
}

template <class Visit>
void ObservationBuilder::in_order(const Visit& visit) const {
  if (!by_time_) {
    for (std::size_t term = 0; term < terms_.size(); ++term)
      for (std::size_t instant = 0; instant < terms_[term].history; ++instant) visit(term, instant);
    return;
  }
  for (std::size_t instant = 0; instant < terms_.front().history; ++instant)
    for (std::size_t term = 0; term < terms_.size(); ++term) visit(term, instant);
}

void ObservationBuilder::place_images() {
  if (terms_.empty()) return;
  std::size_t at = 0;
  in_order([&](std::size_t index, std::size_t /*instant*/) {
    const Term& term = terms_[index];
    if (term.channels != 0) image_places_.push_back({index, term.sensor, at, term.width});
    at += term.width;
  });
  seen_images_.resize(image_places_.size());
}

void ObservationBuilder::reset() {
  began_at_ = {};
  for (Term& term : terms_) {
    term.filled = false;
    term.sample_seen = 0;
  }
}

float ObservationBuilder::value_of(const Term& term, std::size_t i, const Observation& observation,
                                   std::span<const SensorSample> samples, std::span<const float> last_action) const {
  switch (term.kind) {
    case TermKind::joint_position_relative:
      return observation.q[term.joints[i]] - home_[term.joints[i]];
    case TermKind::joint_position:
      return observation.q[term.joints[i]];
    case TermKind::joint_velocity:
      return observation.dq[term.joints[i]];
    case TermKind::drive_velocity:
      return observation.dq_of_drive[term.joints[i]];
    case TermKind::joint_torque:
      return observation.tau[term.joints[i]];
    case TermKind::sensor:
    case TermKind::command:
      return samples[term.sensor].values[i];
    case TermKind::last_action:
      return last_action[i];
    case TermKind::constant:
      return term.constant[i];
    case TermKind::base_angular_velocity:
      return observation.imu.angular_velocity[i];
    case TermKind::projected_gravity:
      return projected_gravity(observation.imu)[i];
    case TermKind::gait_phase:
      return gait(observation.published_at - began_at_, term.gait_period)[i];
    case TermKind::base_orientation:
      return observation.imu.rotation[term.xyzw ? (i + 1) % 4 : i];
    case TermKind::motion_reference:
      return 0.0F;
  }
  return 0.0F;
}

// Not a number stays one.
float ObservationBuilder::scaled(const Term& term, std::size_t i, float value) {
  const float clipped = value < term.low ? term.low : value > term.high ? term.high : value;
  return (term.scale[i] * clipped - term.mean[i]) / term.standard_deviation[i];
}

void ObservationBuilder::read(const Term& term, const Observation& observation, std::span<const SensorSample> samples,
                              std::span<const float> last_action) {
  for (std::size_t i = 0; i < term.width; ++i)
    newest_[i] = scaled(term, i, value_of(term, i, observation, samples, last_action));
}

void ObservationBuilder::read_image(const Term& term, std::span<const std::uint8_t> image, std::span<float> values) {
  const std::size_t pixels = term.width / term.channels;
  for (std::size_t pixel = 0; pixel < pixels; ++pixel)
    for (std::size_t channel = 0; channel < term.channels; ++channel) {
      const std::size_t at = pixel * term.channels + channel;
      values[term.by_channel ? channel * pixels + pixel : at] = term.of_byte[kByteValues * channel + image[at]];
    }
}

void ObservationBuilder::put_image(const ImagePlace& place, std::span<const std::uint8_t> image,
                                   std::span<float> input) const {
  read_image(terms_[place.term], image, input.subspan(place.at, place.width));
}

// As remember() does with its values, and before it.
void ObservationBuilder::remember_image(Term& term, const SensorSample& sample) {
  const SeenImage newest{term.sensor, sample.sequence, sample.sensed_at, sample.published_at};
  if (!term.filled) {
    std::ranges::fill(term.seen, newest);
    return;
  }
  std::copy(term.seen.begin() + 1, term.seen.end(), term.seen.begin());
  term.seen.back() = newest;
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
                                                 std::span<const float> last_action, Images images) {
  if (!began_at_.is_set()) began_at_ = observation.published_at;
  for (Term& term : terms_) {
    if (term.kind == TermKind::sensor) {
      const SensorSample& sample = samples[term.sensor];
      if (term.filled && sample.sequence == term.sample_seen && sample.published_at == term.sample_published) continue;
      term.sample_seen = sample.sequence;
      term.sample_published = sample.published_at;
    }
    if (term.channels != 0) {
      read_image(term, images[term.sensor], newest_);
      remember_image(term, samples[term.sensor]);
    } else {
      read(term, observation, samples, last_action);
    }
    remember(term, std::span(newest_).first(term.width));
  }
  auto out = input_.begin();
  auto seen = seen_images_.begin();
  in_order([&](std::size_t index, std::size_t instant) {
    const Term& term = terms_[index];
    out = std::ranges::copy(instant_of(term, instant), out).out;
    if (term.channels != 0) *seen++ = term.seen[from_oldest(term, instant)];
  });
  return input_;
}

std::size_t ObservationBuilder::from_oldest(const Term& term, std::size_t instant) const {
  return newest_first_ ? term.history - 1 - instant : instant;
}

std::span<const float> ObservationBuilder::instant_of(const Term& term, std::size_t instant) const {
  return std::span(term.past).subspan(from_oldest(term, instant) * term.width, term.width);
}

}  // namespace takt::policy_host
