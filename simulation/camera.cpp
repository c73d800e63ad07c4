// SPDX-License-Identifier: Apache-2.0
#include "simulation/camera.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulation/chance.hpp"

namespace takt::simulation {

namespace {

constexpr std::uint64_t kStepStream = 1000;  // beyond the places that drives draw from

config::Vector3 step_at(const config::Simulation& simulation, Duration since_start) {
  const std::int64_t step = since_start.ns / simulation.step_period.ns;
  if (step <= 0) return {};
  std::mt19937_64 random(seed_for(simulation.seed, kStepStream + static_cast<std::uint64_t>(step)));
  const double unit = static_cast<double>(random() >> 11U) * 0x1p-53;  // 53 random bits in [0, 1)
  return {(2 * unit - 1) * simulation.step_amplitude, 0, 0};
}

}  // namespace

config::Vector3 target_at(const config::Simulation& simulation, Duration since_start) {
  if (simulation.target == config::TargetKind::steps) return step_at(simulation, since_start);
  config::Vector3 at{};
  for (std::size_t axis = 0; axis < at.size(); ++axis) {
    const double phase = 2 * std::numbers::pi * simulation.target_frequency[axis] * since_start.seconds();
    at[axis] = simulation.target_centre[axis] + simulation.target_amplitude[axis] * std::sin(phase);
  }
  return at;
}

Camera::Camera(const config::Simulation& simulation, MonoTime started)
    : simulation_(simulation), started_(started), random_(simulation.seed) {
  expose_next();
}

void Camera::expose_next() {
  // 53 random bits in [0, 1): the same on every standard library, unlike its distributions.
  const double unit = static_cast<double>(random_() >> 11U) * 0x1p-53;
  const auto jitter = static_cast<std::int64_t>((2 * unit - 1) * static_cast<double>(simulation_.camera_jitter.ns));
  shutter_ = started_ + simulation_.camera_period * exposures_;
  ready_ = shutter_ + Duration{std::max<std::int64_t>(simulation_.camera_delay.ns + jitter, 0)};
  ++exposures_;
}

std::optional<SensorSample> Camera::poll(MonoTime now) {
  if (now < ready_) return std::nullopt;
  MonoTime sensed_at = shutter_;
  while (now >= ready_) {
    sensed_at = shutter_;
    expose_next();
  }
  SensorSample sample;
  sample.sequence = ++sequence_;
  sample.sensed_at = sensed_at;
  sample.published_at = now;
  sample.value_count = simulation_.target == config::TargetKind::steps ? 1 : 3;
  const config::Vector3 target = target_at(simulation_, sensed_at - started_);
  std::transform(target.begin(), target.begin() + sample.value_count, sample.values,
                 [](double x) { return static_cast<float>(x); });
  return sample;
}

}  // namespace takt::simulation
