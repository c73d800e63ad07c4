// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated camera delivers what it saw at the shutter, late by its delay and jitter, repeatably.
#include "simulation/camera.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace takt::simulation {
namespace {

config::Simulation simulation(std::uint64_t seed = 7) {
  config::Simulation made;
  made.seed = seed;
  made.camera_period = milliseconds(33);
  made.camera_delay = milliseconds(18);
  made.camera_jitter = milliseconds(4);
  made.target_centre = {0.4, 0, 0.3};
  made.target_amplitude = {0.1, 0.2, 0.05};
  made.target_frequency = {0.25, 0.5, 0};
  return made;
}

constexpr MonoTime kStart{1'000'000'000};

std::vector<SensorSample> watch(Camera& camera, Duration length) {
  std::vector<SensorSample> seen;
  for (Duration t; t < length; t = t + microseconds(100))
    if (const auto sample = camera.poll(kStart + t)) seen.push_back(*sample);
  return seen;
}

TEST(Camera, DeliversEveryShutterLateByDelayAndJitter) {
  Camera camera(simulation(), kStart);
  const auto seen = watch(camera, seconds(10));
  ASSERT_NEAR(static_cast<double>(seen.size()), 303, 1);
  Duration least = seconds(1);
  Duration most;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].sequence, i + 1);
    EXPECT_EQ(seen[i].value_count, 3U);
    EXPECT_EQ(seen[i].sensed_at, kStart + milliseconds(33) * static_cast<std::int64_t>(i));
    const Duration late = seen[i].published_at - seen[i].sensed_at;
    least = std::min(least, late);
    most = std::max(most, late);
    EXPECT_GE(late, milliseconds(14));
    EXPECT_LE(late, milliseconds(22) + microseconds(100));
  }
  EXPECT_LT(least, milliseconds(15)) << "jitter uses its whole range";
  EXPECT_GT(most, milliseconds(21));
}

TEST(Camera, ShowsTheTargetAsItWasAtTheShutter) {
  Camera camera(simulation(), kStart);
  for (const SensorSample& sample : watch(camera, seconds(3))) {
    const config::Vector3 target = target_at(simulation(), sample.sensed_at - kStart);
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_FLOAT_EQ(sample.values[axis], static_cast<float>(target[axis]));
  }
}

TEST(Camera, TheTargetIsALissajousFigure) {
  // After one second: 0.25 Hz is at its crest, 0.5 Hz back at its centre, 0 Hz never moves.
  const config::Vector3 target = target_at(simulation(), seconds(1));
  EXPECT_NEAR(target[0], 0.5, 1e-12);
  EXPECT_NEAR(target[1], 0, 1e-12);
  EXPECT_NEAR(target[2], 0.3, 1e-12);
}

TEST(Camera, TheSeedDecidesTheJitter) {
  const auto delays = [](std::uint64_t seed) {
    Camera camera(simulation(seed), kStart);
    std::vector<std::int64_t> found;
    for (const SensorSample& sample : watch(camera, seconds(2)))
      found.push_back((sample.published_at - sample.sensed_at).ns);
    return found;
  };
  EXPECT_EQ(delays(7), delays(7));
  EXPECT_NE(delays(7), delays(8));
}

TEST(Camera, AfterAStallTheNewestSampleOnly) {
  Camera camera(simulation(), kStart);
  const auto sample = camera.poll(kStart + milliseconds(330));
  ASSERT_TRUE(sample);
  EXPECT_GE(sample->sensed_at, kStart + milliseconds(297));
  EXPECT_EQ(sample->sequence, 1U);
  EXPECT_FALSE(camera.poll(kStart + milliseconds(330)));
}

}  // namespace
}  // namespace takt::simulation
