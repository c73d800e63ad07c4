// SPDX-License-Identifier: Apache-2.0
// Goal: after arming and after degraded mode the robot does not jump to where the policy went meanwhile: its speed
// limits rise over resume_over. Method: the whole tick in virtual time, with a policy that asks for a far pose.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "executive/pipeline/control_tick.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

// How fast the reference went in each tick after tracking began, with a policy that asks for a far pose throughout.
std::vector<float> speeds_of_resuming(const TickConfig& config) {
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(1000, 0.0F);
  rig.run(300);
  for (int i = 0; i < 1000 && rig.mode() != Mode::tracking; ++i) rig.tick_with_policy(-1.4F);
  std::vector<float> speeds;
  for (int i = 0; i < 600; ++i) {
    speeds.push_back(std::abs(rig.out->record.joints[0].dq_reference));
    rig.tick_with_policy(-1.4F);
  }
  return speeds;
}

TEST(ResumeRamp, SpeedLimitsRiseFromTheScaleToAllOfThemOverItsTime) {
  TickConfig config = robot(1);
  config.joints[0].limits.acceleration = 300.0F;  // so that the speed limit decides
  config.resume_over = milliseconds(200);
  const std::vector<float> speeds = speeds_of_resuming(config);
  const float full = config.joints[0].limits.velocity, scale = config.degraded_speed_scale;
  for (int i = 0; i < 200; ++i) {
    const float share = static_cast<float>(i) / 200.0F;
    const float limit = full * (scale + (1 - scale) * share);
    ASSERT_LE(speeds[static_cast<std::size_t>(i)], limit + 1e-4F) << "tick " << i;
    ASSERT_GE(speeds[static_cast<std::size_t>(i)], i < 20 ? 0.0F : limit - 0.02F * full) << "tick " << i;
  }
  EXPECT_NEAR(speeds[240], full, 1e-3F);
}

TEST(ResumeRamp, WithoutOneTheFullSpeedIsThereAtOnce) {
  TickConfig config = robot(1);
  config.joints[0].limits.acceleration = 300.0F;
  EXPECT_NEAR(speeds_of_resuming(config)[40], config.joints[0].limits.velocity, 1e-3F);
}

TEST(ResumeRamp, AlsoBeginsWithArmingAndWithNothingElse) {
  TickConfig config = robot(1);
  config.joints[0].limits.acceleration = 300.0F;
  config.resume_over = milliseconds(200);
  config.freshness.epsilon = 0.1;  // a late command is no violation yet
  const float slow = config.joints[0].limits.velocity * config.degraded_speed_scale;
  Rig rig(config);
  rig.run_with_policy(40, 1.4F);
  rig.tick_with_policy(1.4F, OperatorRequest::arm);
  while (rig.mode() != Mode::tracking) rig.tick_with_policy(1.4F);
  rig.run_with_policy(15, 1.4F);
  EXPECT_LT(rig.out->record.joints[0].dq_reference, 1.2F * slow);
  rig.run_with_policy(600, -1.0F);
  while (rig.header().seats[Seat::policy].freshness != Freshness::stale) rig.tick();
  float fastest = 0;
  for (int i = 0; i < 60; ++i) {
    rig.tick_with_policy(1.4F);
    fastest = std::max(fastest, rig.out->record.joints[0].dq_reference);
  }
  EXPECT_EQ(rig.mode(), Mode::tracking);
  EXPECT_NEAR(fastest, config.joints[0].limits.velocity, 1e-4F) << "a late command that leaves no mode starts no ramp";
}

}  // namespace
}  // namespace takt::pipeline
