// SPDX-License-Identifier: Apache-2.0
// Goal: the tick runs with the numbers the file says. Method: the small robot's values, in float32, and the rotation of
// a frame against vectors turned by hand.
#include "executive/setup/tick_config_of.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "config/load.hpp"
#include "executive/pipeline/brake.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "tests/config/small_robot.hpp"

namespace takt::config {
namespace {

pipeline::TickConfig tick_of(std::string_view text) {
  const auto robot = parse(text, "r");
  EXPECT_TRUE(robot.has_value()) << robot.error();
  return setup::tick_config_of(*robot, 7);
}

TEST(TickConfigOf, CarriesTimingContractAndCounts) {
  const auto tick = tick_of(test::kSmallRobot);
  EXPECT_EQ(tick.period, milliseconds(1));
  EXPECT_EQ(tick.joint_count, 2U);
  EXPECT_EQ(tick.bus_count, 1U);
  EXPECT_EQ(tick.observation_every_ticks, 20U);
  EXPECT_EQ(tick.policy.hash, 7U);
  EXPECT_EQ(tick.freshness.max_age, milliseconds(120));
  EXPECT_EQ(tick.freshness.window_ticks, 1000U);
  EXPECT_EQ(tick.freshness.stop_after, milliseconds(600));
  EXPECT_EQ(tick.degraded, pipeline::DegradedBehaviour::fallback);
}

TEST(TickConfigOf, TheShareOfLatePeriodsIsTheFiles) {
  EXPECT_EQ(tick_of(test::kSmallRobot).late_share, pipeline::TickConfig{}.late_share) << "the same default";
  EXPECT_EQ(tick_of(test::with("spin: 100 us", "spin: 100 us, late_share: 0.5")).late_share, 0.5);
}

TEST(TickConfigOf, AStampIsAskedForWhereThePolicyUsesASensor) {
  EXPECT_TRUE(tick_of(test::kSmallRobot).policy.needs_outside_stamp);
  EXPECT_FALSE(tick_of(test::with("term: sensor, sensor: target, scale: [1, 1, 0.5]", "term: constant, values: [1]"))
                   .policy.needs_outside_stamp);
}

constexpr const char* kPose = "kind: pose, speed: 0.5 rad/s, pose: [0 rad, 10 deg]";  // of the small robot

TEST(TickConfigOf, AFallbackPolicyHasItsOwnHashItsTimeAndTheBound) {
  std::string text = test::with(kPose, "kind: policy, for: 20 s");
  constexpr std::string_view kChosen = "fallback: tuck }";
  text.replace(text.find(kChosen), kChosen.size(), "fallback: tuck, after: 40 ms }");
  const auto robot = parse(text, "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  const auto tick = setup::tick_config_of(*robot, 7, 8);
  EXPECT_TRUE(pipeline::has_fallback_policy(tick));
  EXPECT_EQ(tick.fallback_policy.hash, 8U);
  EXPECT_TRUE(tick.fallback_policy.needs_outside_stamp) << "it reads the same sensor";
  EXPECT_EQ(tick.fallback_longest, seconds(20));
  EXPECT_EQ(tick.freshness.degrade_after, milliseconds(40));
  EXPECT_FALSE(pipeline::has_fallback_policy(tick_of(test::kSmallRobot)));
}

TEST(TickConfigOf, AsManyObservationsAreRememberedAsMaxAgeHolds) {
  EXPECT_EQ(pipeline::remembered_observations(tick_of(test::kSmallRobot)), 120U / 20U + 2U);
}

TEST(TickConfigOf, TheResumeRampHasADefault) {
  EXPECT_EQ(tick_of(test::kSmallRobot).resume_over, seconds(2));
  EXPECT_EQ(tick_of(test::with("fallback: tuck }", "fallback: tuck, resume_over: 0 ms }")).resume_over, Duration{});
}

TEST(TickConfigOf, ARecorderIsRequiredUnlessTheFileSaysOtherwise) {
  EXPECT_EQ(tick_of(test::kSmallRobot).unrecorded_limit, pipeline::kLongestUnrecorded);
  const std::string optional = std::string(test::kSmallRobot) + "record: { recorder: optional }\n";
  EXPECT_EQ(tick_of(optional).unrecorded_limit, 0U);
}

TEST(TickConfigOf, BusFaultsHaveDefaultsAndBecomeTicksAndShares) {
  const pipeline::BusFaultLimits none = tick_of(test::kSmallRobot).bus_faults;
  const pipeline::BusFaultLimits defaults;
  EXPECT_EQ(std::memcmp(&none, &defaults, sizeof none), 0) << "the tick's own defaults are the file's";
  const auto given =
      tick_of(test::with("feedback: { timeout: 20 ms }\n",
                         "feedback: { timeout: 20 ms }\nbus_faults: { window: 250 ms, replies_lost: 0.25, "
                         "replies_repeated: 0.5, replies_delayed: 1, transmit_drops: 0.125, receive_drops: 0.0625, "
                         "foreign_frames: 0.75, babble: 0.375, error_passive: 0.875 }\n"))
          .bus_faults;
  EXPECT_EQ(given.window_ticks, 250U);
  EXPECT_EQ(given.replies_lost, 16384U);
  EXPECT_EQ(given.replies_repeated, 32768U);
  EXPECT_EQ(given.replies_delayed, pipeline::kWholeShare);
  EXPECT_EQ(given.transmit_drops, 8192U);
  EXPECT_EQ(given.receive_drops, 4096U);
  EXPECT_EQ(given.foreign_frames, 49152U);
  EXPECT_EQ(given.babble, 24576U);
  EXPECT_EQ(given.error_passive, 57344U);
}

TEST(TickConfigOf, OnlyTheConfiguredFallbackGivesPoseAndSpeed) {
  const auto tuck = tick_of(test::kSmallRobot);
  EXPECT_FLOAT_EQ(tuck.joints[1].fallback_pose, 0.17453293F);
  EXPECT_FLOAT_EQ(tuck.joints[1].fallback_speed, 0.5F);
  const auto hold = tick_of(test::with("behaviour: fallback, fallback: tuck", "behaviour: hold"));
  EXPECT_FLOAT_EQ(hold.joints[1].fallback_pose, 0.2F) << "home";
  EXPECT_FLOAT_EQ(hold.joints[1].fallback_speed, 0.0F);
}

TEST(TickConfigOf, JointsCarryLimitsAndGains) {
  const auto hip = tick_of(test::kSmallRobot).joints[0];
  EXPECT_FLOAT_EQ(hip.limits.q_max, 1.0F);
  EXPECT_FLOAT_EQ(hip.limits.torque_rate, 900.0F);
  EXPECT_FLOAT_EQ(hip.limits.q_hard_margin, 0.1F);
  EXPECT_FLOAT_EQ(hip.kp, 60.0F);
  EXPECT_FLOAT_EQ(hip.inertia, 0.1F);
  EXPECT_FLOAT_EQ(hip.inertia_max, 0.0F) << "not stated";
  EXPECT_FLOAT_EQ(
      tick_of(test::with("inertia: 0.1 kgm2", "inertia: 0.1 kgm2\n    inertia_max: 0.3 kgm2")).joints[0].inertia_max,
      0.3F);
}

// None of them pays for the look at what torque is left.
TEST(TickConfigOf, TheDemoArmsAndTheCartHaveTorqueForTheirWholeAccelerationInEveryPose) {
  for (const char* file : {"arm6", "arm6_visuomotor", "dual_arm12", "cart_pole"}) {
    const auto robot = load("config/" + std::string(file) + ".yaml");
    ASSERT_TRUE(robot) << robot.error();
    const pipeline::TickConfig tick = setup::tick_config_of(*robot, 0);
    EXPECT_EQ(pipeline::scarce_joints(tick, pipeline::GravityModel(tick)), 0U) << file;
  }
}

// Roll by 90 deg takes y to z and z to -y.
TEST(TickConfigOf, RotationIsFixedAxisRollPitchYawAndAxesAreUnit) {
  const auto tick = tick_of(test::kSmallRobot);
  const auto& r = tick.links[1].origin_rotation;
  const std::array<float, 9> expected{1, 0, 0, 0, 0, -1, 0, 1, 0};
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(r[i], expected[i], 1e-6F) << i;
  EXPECT_FLOAT_EQ(tick.links[0].axis[1], 1.0F) << "[0, 2, 0] is made a unit vector";
  EXPECT_TRUE(tick.gravity_compensation);
  // Yaw after roll: Rz(90) Rx(90) takes y to z, and x to y.
  const auto turned = tick_of(test::with("rpy: [90 deg, 0 deg, 0 deg]", "rpy: [90 deg, 0 deg, 90 deg]")).links[1];
  EXPECT_NEAR(turned.origin_rotation[3], 1.0F, 1e-6F);
  EXPECT_NEAR(turned.origin_rotation[7], 1.0F, 1e-6F);
}

TEST(TickConfigOf, NoModelMeansNoGravityCompensation) {
  std::string text(test::kSmallRobot);
  text.erase(text.find("model:\n"), text.find("sensors:") - text.find("model:\n"));
  text.erase(text.find("simulation:"));
  EXPECT_FALSE(tick_of(text).gravity_compensation);
}

}  // namespace
}  // namespace takt::config
