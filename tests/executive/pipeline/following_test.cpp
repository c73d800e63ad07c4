// SPDX-License-Identifier: Apache-2.0
// Goal: a joint that is held away from its reference for longer than it may be is told, degrades the robot or stops it,
// as the robot file says, and the stop does not push on; a joint that follows, a soft one and a passive one are never
// behind. Method: the rig's robot, whose joint 1 a hand grips.
#include "executive/pipeline/following.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

constexpr int kTimeout_ticks = 500;
constexpr float kFar = 1.0F;  // rad, a target beyond what the hand lets the joint reach

TickConfig robot_with(FollowingReaction then) {
  TickConfig config = testing::robot(3);
  config.freshness.recover_after = milliseconds(50);
  config.following = {.timeout = milliseconds(kTimeout_ticks), .then = then};
  return config;
}

class FollowingRig : public testing::Rig {
 public:
  explicit FollowingRig(FollowingReaction then = FollowingReaction::warn) : FollowingRig(robot_with(then)) {}
  explicit FollowingRig(const TickConfig& robot) : Rig(robot) { arm(); }
  void grip() { drives[1].gripped = true; }
  void let_go() { drives[1].gripped = false; }
  [[nodiscard]] bool holds(Cause cause) const { return (header().causes_active & bit(cause)) != 0; }
  [[nodiscard]] bool is_behind(std::size_t j) const { return out->record.joints[j].behind != 0; }
  // Ticks until joint 1 is behind; 0: not within 3000.
  int until_behind(float target) {
    for (int i = 1; i <= 3000; ++i) {
      tick_with_policy(target);
      if (is_behind(1)) return i;
    }
    return 0;
  }
};

TEST(Following, AJointThatIsHeldIsTold) {
  FollowingRig rig;
  rig.grip();
  const int took = rig.until_behind(kFar);
  ASSERT_GT(took, kTimeout_ticks) << "its reference needs time to get away, and it may be away for the timeout";
  EXPECT_LT(took, kTimeout_ticks + 400);
  EXPECT_FALSE(rig.is_behind(0));
  EXPECT_FALSE(rig.is_behind(2));
  EXPECT_TRUE(rig.holds(Cause::following_error));
  EXPECT_FALSE(rig.holds(Cause::following_lost));
  rig.run_with_policy(2000, kFar);
  EXPECT_EQ(rig.mode(), Mode::tracking) << "told, and nothing more";
  rig.let_go();
  rig.run_with_policy(200, kFar);
  EXPECT_FALSE(rig.holds(Cause::following_error));
}

TEST(Following, TheTimeoutBeginsAnewWheneverTheJointFollows) {
  FollowingRig rig;
  for (int again = 0; again < 4; ++again) {
    rig.grip();
    rig.run_with_policy(kTimeout_ticks, again % 2 == 0 ? kFar : -kFar);
    EXPECT_FALSE(rig.holds(Cause::following_error)) << again;
    rig.let_go();
    rig.run_with_policy(1500, 0.0F);
  }
}

TEST(Following, DegradesUntilTheJointFollows) {
  TickConfig config = robot_with(FollowingReaction::degrade);
  config.degraded = DegradedBehaviour::slow;
  FollowingRig rig(config);
  rig.grip();
  ASSERT_NE(rig.until_behind(kFar), 0);
  EXPECT_EQ(rig.mode(), Mode::degraded);
  EXPECT_EQ(rig.header().cause, Cause::following_error);
  rig.run_with_policy(1000, kFar);
  EXPECT_EQ(rig.mode(), Mode::degraded) << "its commands are fresh, and the joint is held";
  rig.let_go();
  rig.run_with_policy(1000, kFar);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

// Holding begins where the joint is, so that it follows again: the robot asks anew, later from time to time.
TEST(Following, HoldingPushesNoMoreAndIsTriedAgainLaterEachTime) {
  FollowingRig rig(FollowingReaction::degrade);
  rig.grip();
  ASSERT_NE(rig.until_behind(kFar), 0);
  int degraded = 0, gentle = 0;
  for (int i = 0; i < 8000; ++i) {
    rig.tick_with_policy(kFar);
    degraded += rig.mode() == Mode::degraded ? 1 : 0;
    const float torque = std::abs(rig.out->record.joints[1].tau_total);
    gentle += torque < 0.5F * rig.config.joints[1].limits.torque ? 1 : 0;
  }
  EXPECT_GT(degraded, 1500);
  EXPECT_GT(gentle, 3000) << "told alone it pushes with all its torque for ever";
  rig.let_go();
  rig.run_with_policy(3000, kFar);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(Following, StopsAndLetsGo) {
  FollowingRig rig(FollowingReaction::stop);
  rig.grip();
  ASSERT_NE(rig.until_behind(kFar), 0);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_EQ(rig.header().cause, Cause::following_lost);
  rig.run(500);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_LT(std::abs(rig.out->record.joints[1].tau_total), 0.1F * rig.config.joints[1].limits.torque)
      << "the hand is pushed no more";
  rig.let_go();
  float fastest = 0;
  for (int i = 0; i < 1000; ++i) {
    rig.tick();
    fastest = std::max(fastest, std::abs(rig.drives[1].dq));
  }
  EXPECT_LT(fastest, 0.1F) << "rad/s, true motion, when the hand lets go";
}

TEST(Following, ByTheRobotFilesOwnLimitWhereItHasOne) {
  TickConfig config = robot_with(FollowingReaction::warn);
  config.joints[1].following_error = 0.05F;
  FollowingRig narrow(config);
  narrow.grip();
  const int took = narrow.until_behind(0.1F);
  EXPECT_GT(took, kTimeout_ticks);
  config.joints[1].following_error = 1.0F;  // more than the torque can pull
  FollowingRig wide(config);
  wide.grip();
  EXPECT_EQ(wide.until_behind(kFar), 0);
}

TEST(Following, IsNotLookedForWithoutATimeout) {
  TickConfig config = robot_with(FollowingReaction::stop);
  config.following.timeout = {};
  FollowingRig rig(config);
  rig.grip();
  EXPECT_EQ(rig.until_behind(kFar), 0);
}

TEST(Following, WithoutStiffnessNothingIsBehind) {
  TickConfig config = robot_with(FollowingReaction::stop);
  for (std::size_t j = 0; j < 3; ++j) config.joints[j].kp = 0.0F;
  FollowingRig rig(config);
  rig.grip();
  EXPECT_EQ(rig.until_behind(kFar), 0);
}

TEST(Following, AVelocityLoopIsJudgedByAKeyOfItsOwnOnly) {
  JointState joint;
  JointConfig config = testing::robot(1).joints[0];
  joint.kp_before = 100.0F;
  joint.reference.q = 1.0;
  EXPECT_GT(following_share(joint, 0.0F, config), 1.0F);
  config.loop = LoopAt::host_velocity;
  EXPECT_EQ(following_share(joint, 0.0F, config), 0.0F) << "its gains ask for no torque";
  config.following_error = 0.5F;
  EXPECT_FLOAT_EQ(following_share(joint, 0.0F, config), 2.0F);
  config.passive = true;
  EXPECT_EQ(following_share(joint, 0.0F, config), 0.0F);
}

TEST(Following, AJointThatFollowsStaysFarFromTheLimit) {
  FollowingRig rig;
  float largest = 0;
  for (int i = 0; i < 6000; ++i) {
    rig.tick_with_policy(i / 1500 % 2 == 0 ? kFar : -kFar);
    for (std::size_t j = 0; j < 3; ++j)
      largest = std::max(largest, following_share(rig.state->joints[j], rig.drives[j].q, rig.config.joints[j]));
    ASSERT_FALSE(rig.holds(Cause::following_error));
  }
  EXPECT_GT(largest, 0.0F);
  EXPECT_LT(largest, 0.9F) << "of its limit, at full speed and acceleration";
}

TEST(Following, ASuspendForgetsWhoWasBehind) {
  FollowingRig rig;
  rig.grip();
  ASSERT_NE(rig.until_behind(kFar), 0);
  rig.input.slept_ms = 5000;
  rig.tick();
  rig.input.slept_ms = 0;
  EXPECT_FALSE(rig.is_behind(1));
}

}  // namespace
}  // namespace takt::pipeline
