// SPDX-License-Identifier: Apache-2.0
// Goal: a hot drive is told, degrades the robot where the robot file says so, or stops it, by the part that is hot;
// what made the robot stop has to cool before it arms again; a drive that tells nothing is not armed under a limit.
// Method: the rig's robot, its drives' temperatures written by the test.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

TickConfig warm_robot(bool degrades) {
  TickConfig config = testing::robot(3);
  config.freshness.recover_after = milliseconds(50);
  config.temperature_degrades = degrades;
  for (std::size_t j = 0; j < 3; ++j)
    config.joints[j].temperature = {.warning = 100, .stop = 120, .casing_warning = 75, .casing_stop = 85};
  return config;
}

class WarmRig : public testing::Rig {
 public:
  explicit WarmRig(bool degrades = false) : Rig(warm_robot(degrades)) {
    for (std::size_t j = 0; j < 3; ++j) heat(j, 60, 50);
    arm();
  }
  void heat(std::size_t joint, float hottest, std::uint8_t casing) {
    input.joints[joint].temperature_C = hottest;
    input.joints[joint].casing_C = casing;
  }
  [[nodiscard]] bool holds(Cause cause) const { return (header().causes_active & bit(cause)) != 0; }
  [[nodiscard]] bool is_blocked_by(std::string_view word) const {
    std::array<ArmingBlocker, 16> found;
    const std::size_t count = arming_blockers(out->record, config, found);
    return std::any_of(found.begin(), found.begin() + count,
                       [&](const ArmingBlocker& one) { return one.what.find(word) != std::string_view::npos; });
  }
};

TEST(Temperatures, AWarningIsToldAndDegradesWhereTheRobotFileSaysSo) {
  for (const bool degrades : {false, true}) {
    for (const bool casing : {false, true}) {
      WarmRig rig(degrades);
      ASSERT_EQ(rig.mode(), Mode::tracking);
      rig.heat(1, casing ? 60 : 100, casing ? 75 : 50);
      rig.run_with_policy(20, 0.1F);
      EXPECT_FALSE(rig.holds(Cause::temperature_high)) << "at the limit, not beyond it";
      rig.heat(1, casing ? 60 : 101, casing ? 76 : 50);
      rig.tick_with_policy(0.1F);
      EXPECT_TRUE(rig.holds(Cause::temperature_high));
      EXPECT_EQ(rig.mode(), degrades ? Mode::degraded : Mode::tracking);
      rig.run_with_policy(500, 0.1F);
      EXPECT_EQ(rig.mode(), degrades ? Mode::degraded : Mode::tracking);
    }
  }
}

TEST(Temperatures, DegradedByHeatItStaysSoUntilItIsCooler) {
  WarmRig rig(true);
  rig.heat(2, 103, 50);
  rig.tick_with_policy(0.1F);
  ASSERT_EQ(rig.mode(), Mode::degraded);
  rig.heat(2, 97, 50);
  rig.run_with_policy(500, 0.1F);
  EXPECT_EQ(rig.mode(), Mode::degraded) << "below the warning, and not by 5 degrees";
  rig.heat(2, 95, 50);
  rig.run_with_policy(500, 0.1F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(Temperatures, BeyondTheLimitTheRobotStopsAndArmsNoMoreUntilItIsCooler) {
  for (const bool casing : {false, true}) {
    WarmRig rig;
    rig.heat(0, casing ? 60 : 121, casing ? 86 : 50);
    rig.tick_with_policy(0.1F);
    EXPECT_EQ(rig.mode(), Mode::damped_stop) << "in the tick that read it";
    EXPECT_EQ(rig.header().cause, Cause::overtemperature);
    rig.run_with_policy(1500, 0.1F);
    rig.tick_with_policy(0.1F, OperatorRequest::reset);
    ASSERT_EQ(rig.mode(), Mode::standby);
    rig.heat(0, casing ? 60 : 117, casing ? 82 : 50);
    rig.run_with_policy(30, 0.1F);
    EXPECT_TRUE(rig.is_blocked_by("too hot"));
    rig.tick_with_policy(0.1F, OperatorRequest::arm);
    EXPECT_EQ(rig.mode(), Mode::standby);
    rig.heat(0, casing ? 60 : 115, casing ? 80 : 50);
    rig.run_with_policy(30, 0.1F);
    EXPECT_FALSE(rig.is_blocked_by("too hot"));
    rig.tick_with_policy(0.1F, OperatorRequest::arm);
    EXPECT_EQ(rig.mode(), Mode::arming);
  }
}

TEST(Temperatures, ADriveThatTellsNoneIsNotArmedUnderALimit) {
  for (const bool casing : {false, true}) {
    testing::Rig cold(warm_robot(false));
    for (std::size_t j = 0; j < 3; ++j) {
      cold.input.joints[j].temperature_C = !casing && j == 1 ? 0 : 40;
      cold.input.joints[j].casing_C = casing && j == 1 ? 0 : 40;
    }
    cold.run_with_policy(40, 0.0F);
    std::array<ArmingBlocker, 16> found;
    const std::size_t count = arming_blockers(cold.out->record, cold.config, found);
    ASSERT_EQ(count, 1U);
    EXPECT_EQ(found[0].joint, 1);
    EXPECT_NE(found[0].what.find("tells no temperature"), std::string_view::npos);
    cold.config.joints[1].temperature = {};
    EXPECT_EQ(arming_blockers(cold.out->record, cold.config, found), 0U) << "without a limit nobody asks";
  }
}

TEST(Temperatures, WithoutLimitsNothingIsTooHot) {
  testing::Rig rig(testing::robot(2));
  rig.arm();
  rig.input.joints[0].temperature_C = 400;
  rig.input.joints[0].casing_C = 255;
  rig.run_with_policy(100, 0.1F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  EXPECT_EQ(rig.header().causes_active & (bit(Cause::temperature_high) | bit(Cause::overtemperature)), 0U);
}

TEST(Temperatures, ReadingsRoundUpAndAreNeverNone) {
  EXPECT_EQ(whole_degrees(36.0F), 36);
  EXPECT_EQ(whole_degrees(36.1F), 37);
  EXPECT_EQ(whole_degrees(-20.0F), 1);
  EXPECT_EQ(whole_degrees(0.0F), 1);
  EXPECT_EQ(whole_degrees(1000.0F), 255);
}

}  // namespace
}  // namespace takt::pipeline
