// SPDX-License-Identifier: Apache-2.0
// Goal: a loop that is late too often stops the robot, in whatever pattern it is late; one that is late now and then
// does not. Method: virtual time, patterns of late ticks and skipped periods, default share of a quarter.
#include <gtest/gtest.h>

#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/tick_window.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

TickConfig quarter() {
  TickConfig config = robot(2);
  config.late_share = 0.25;
  return config;
}

Rig tracking(const TickConfig& config) {
  Rig rig(config);
  rig.arm(0.1F);
  rig.run_with_policy(200, 0.1F);
  return rig;
}

// Skips that many periods of the grid, then ticks.
void tick_after(Rig& rig, std::uint64_t skipped) {
  rig.input.skipped_periods += skipped;
  rig.now = rig.now + rig.config.period * static_cast<std::int64_t>(skipped);
  rig.tick_with_policy(0.1F);
}

// Late ticks in every window of ten.
void run_late(Rig& rig, int late_of_ten, int ticks) {
  for (int i = 0; i < ticks && rig.mode() == Mode::tracking; ++i) {
    rig.input.lateness = i % 10 < late_of_ten ? rig.config.period : microseconds(40);
    rig.tick_with_policy(0.1F);
  }
}

TEST(LatePeriods, NineOfTenTicksLateStopTheRobot) {
  Rig rig = tracking(quarter());
  run_late(rig, 9, 20'000);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_EQ(rig.header().cause, Cause::overrun);
}

TEST(LatePeriods, MoreThanHalfOfThePeriodsSkippedStopTheRobot) {
  Rig rig = tracking(quarter());
  std::uint64_t ticks = 0;
  for (; ticks < 4'279 && rig.mode() == Mode::tracking; ++ticks) tick_after(rig, ticks % 3 == 0 ? 2 : 1);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_EQ(rig.header().cause, Cause::overrun);
  EXPECT_EQ(rig.input.skipped_periods, 251U) << "one more than a quarter of the window";
}

TEST(LatePeriods, OneOfFiveIsTolerated) {
  Rig rig = tracking(quarter());
  run_late(rig, 2, 20'000);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(LatePeriods, AShareOfOneIsNeverExceeded) {
  TickConfig config = quarter();
  config.late_share = 1;
  Rig rig = tracking(config);
  run_late(rig, 10, 3'000);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(LatePeriods, TheyBlockArmingUntilTheWindowHasForgottenThem) {
  Rig rig(quarter());
  rig.run_with_policy(100, 0.1F);
  tick_after(rig, 300);
  EXPECT_NE(rig.header().causes_active & bit(Cause::overrun), 0U);
  EXPECT_EQ(rig.mode(), Mode::standby) << "nothing to stop";
  rig.run_with_policy(100, 0.1F);
  rig.tick_with_policy(0.1F, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::standby);
  rig.run_with_policy(900, 0.1F);
  EXPECT_EQ(rig.header().causes_active & bit(Cause::overrun), 0U);
  rig.tick_with_policy(0.1F, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::arming);
}

TEST(LatePeriods, AStallOfAnyLengthCostsNoMoreThanTheWindow) {
  TickWindow window;
  window.push_marked(UINT64_MAX, 100);
  EXPECT_EQ(window.count(), 100U);
  for (int i = 0; i < 40; ++i) window.push(false, 100);
  window.push_marked(3, 100);
  EXPECT_EQ(window.count(), 60U) << "three of the stall made way for three new ones";
}

}  // namespace
}  // namespace takt::pipeline
