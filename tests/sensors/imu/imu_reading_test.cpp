// SPDX-License-Identifier: Apache-2.0
// Goal: a sample of the part becomes one of the robot's base, once, and never younger than it is. Method: rotations
// worked out by hand for sensors that are mounted askew; counters and clocks of the part that wrap, repeat, jump,
// restart, wait.
#include "sensors/imu/imu_reading.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace takt::sensors {
namespace {

constexpr MonoTime kStart{7'000'000'000};
constexpr double kQuarter = std::numbers::pi / 2;

std::vector<float> values_of(const config::Vector3& rpy, const MtSample& sample) {
  const auto made = ImuReading(rotation_of(rpy)).take(sample, kStart);
  return made ? std::vector<float>(made->values, made->values + made->value_count) : std::vector<float>{};
}

void expect_near(const std::vector<float>& values, const std::vector<double>& expected) {
  ASSERT_EQ(values.size(), expected.size());
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 1e-6) << "value " << i;
}

TEST(ImuReading, ASensorInTheBaseFrameIsPassedOn) {
  expect_near(values_of({0, 0, 0},
                        {.rotation = {0.5, 0.5, -0.5, 0.5}, .angular_velocity = {1, 2, 3}, .acceleration = {4, 5, 6}}),
              {0.5, 0.5, -0.5, 0.5, 1, 2, 3, 4, 5, 6});
}

TEST(ImuReading, UpsideDownItStillSaysThatTheBaseIsLevel) {
  expect_near(values_of({0, 2 * kQuarter, 0},
                        {.rotation = {0, 0, 1, 0}, .angular_velocity = {1, 2, 3}, .acceleration = {0, 0, -9.81}}),
              {1, 0, 0, 0, -1, 2, -3, 0, 0, 9.81});
}

TEST(ImuReading, TheMountingIsTakenOffBehindTheRotation) {
  // The sensor turned a quarter about the world's x, and sits a quarter about the base's z.
  const double half = std::sqrt(0.5);
  expect_near(values_of({0, 0, kQuarter}, {.rotation = {half, half, 0, 0}}), {0.5, 0.5, 0.5, -0.5, 0, 0, 0, 0, 0, 0});
}

TEST(ImuReading, RollPitchAndYawAreAboutFixedAxesInThisOrder) {
  // A quarter about x, then one about z: the sensor's y is the base's z, its x the base's y, its z the base's x.
  expect_near(values_of({kQuarter, 0, kQuarter},
                        {.rotation = {1, 0, 0, 0}, .angular_velocity = {1, 2, 3}, .acceleration = {0, 9.81, 0}}),
              {0.5, -0.5, -0.5, -0.5, 3, 1, 2, 0, 0, 9.81});
}

MtSample at(std::uint16_t counter, std::uint32_t ticks) {
  return {.counter = counter, .ticks = ticks, .rotation = {1, 0, 0, 0}};
}

TEST(ImuReading, RepeatsAreDroppedAndLossesCounted) {
  ImuReading reading({1, 0, 0, 0});
  std::uint32_t ticks = 0;
  const auto take = [&](std::uint16_t counter) { return reading.take(at(counter, ticks += 100), kStart).has_value(); };
  EXPECT_TRUE(take(65534));
  EXPECT_FALSE(take(65534));
  EXPECT_TRUE(take(65535));
  EXPECT_TRUE(take(0)) << "it wraps";
  EXPECT_EQ(reading.counts().lost, 0U);
  EXPECT_TRUE(take(4));
  EXPECT_EQ(reading.counts().lost, 3U);
  EXPECT_TRUE(take(2)) << "it restarted";
  EXPECT_EQ(reading.counts().lost, 3U);
  EXPECT_EQ(reading.counts().repeated, 1U);
  EXPECT_EQ(reading.counts().samples, 5U);
}

TEST(ImuReading, WhatWaitedInABufferIsNoYoungerForThat) {
  ImuReading reading({1, 0, 0, 0});
  EXPECT_EQ(reading.take(at(0, 0), kStart)->sensed_at, kStart);
  EXPECT_EQ(reading.take(at(1, 100), kStart + milliseconds(10))->sensed_at, kStart + milliseconds(10)) << "in time";
  // 200 ms late: as old as the part's clock says, and 0.2 per mille of 10 ms.
  EXPECT_EQ(reading.take(at(2, 200), kStart + milliseconds(220))->sensed_at,
            kStart + milliseconds(20) + microseconds(2));
  EXPECT_EQ(reading.take(at(3, 300), kStart + milliseconds(30))->sensed_at, kStart + milliseconds(30))
      << "never later than it came";
}

TEST(ImuReading, APartThatBootedAnewIsBelievedFromItsArrivalOn) {
  ImuReading reading({1, 0, 0, 0});
  (void)reading.take(at(500, 4'000'000), kStart);
  const MonoTime again = kStart + seconds(30);
  EXPECT_EQ(reading.take(at(0, 5), again)->sensed_at, again);
}

TEST(ImuReading, AClockThatWrapsOrDriftsIsFollowed) {
  ImuReading reading({1, 0, 0, 0});
  auto ticks = static_cast<std::uint32_t>(-5000);
  MonoTime now = kStart;
  for (std::uint16_t i = 0; i < 1000; ++i) {  // the part is slow by 0.1 per mille
    const auto sample = reading.take(at(i, ticks), now);
    ASSERT_EQ(sample->sensed_at, now) << "message " << i;
    ticks += 100;
    now = now + milliseconds(10) + microseconds(1);
  }
}

}  // namespace
}  // namespace takt::sensors
