// SPDX-License-Identifier: Apache-2.0
// Goal: what goes out instead of a setpoint that comes too late is damping, inside every limit; the tick after goes on
// from what the drive was really told; and the tick says itself until when its setpoints may leave. Method: the rig's
// drives get the damping of chosen joints, and the next tick is told.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

float torque_of(const JointSetpoint& s, const JointRecord& at) {
  return s.kp * (s.q - at.q_estimate) + s.kd * (s.dq - at.dq_estimate) + s.tau;
}

// Fast, and under torque.
Rig moving_rig() {
  Rig rig(robot(3));
  rig.arm(0.0F);
  rig.run_with_policy(200, 1.0F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  EXPECT_GT(std::abs(rig.drives[1].dq), 0.3F);
  return rig;
}

TEST(LateSetpoint, DampingHasNoStiffnessAndKeepsTorqueAndSlewLimits) {
  Rig rig = moving_rig();
  for (int i = 0; i < 200; ++i) {
    const TickRecord before = rig.out->record;
    rig.tick_with_policy(i % 40 < 20 ? 1.2F : -1.0F);
    for (std::size_t j = 0; j < 3; ++j) {
      const JointSetpoint& damping = rig.out->damping[j];
      const JointLimits& limits = rig.config.joints[j].limits;
      EXPECT_EQ(damping.kp, 0.0F);
      const float torque = torque_of(damping, rig.out->record.joints[j]);
      EXPECT_LE(std::abs(torque), limits.torque * 1.001F);
      EXPECT_LE(std::abs(torque - before.joints[j].tau_total), limits.torque_rate * 0.001F * 1.001F + 1e-4F);
    }
  }
}

// Late for long enough, the slew is over, and what is left is damping alone: it pulls against the motion.
TEST(LateSetpoint, WhoIsLateForLongIsDampedAlone) {
  Rig rig = moving_rig();
  rig.late = 0b010;
  rig.run_with_policy(200, 1.2F);
  const JointSetpoint& damping = rig.out->damping[1];
  EXPECT_EQ(damping.kd, rig.config.joints[1].damping);
  EXPECT_EQ(damping.tau, 0.0F);
  EXPECT_LT(std::abs(rig.drives[1].dq), 0.1F);
}

// As long as nothing of it leaves, a reference may not run ahead of the joint and tear it along afterwards.
TEST(LateSetpoint, TheReferenceWaitsForAJointThatIsDamped) {
  Rig rig = moving_rig();
  rig.tick_with_policy(1.4F);
  const float left_at = rig.out->record.joints[1].q_reference;
  const float other_left_at = rig.out->record.joints[0].q_reference;
  rig.late = 0b010;
  rig.run_with_policy(40, 1.4F);
  const float one_step = rig.config.joints[1].limits.velocity * 0.001F;
  EXPECT_NEAR(rig.out->record.joints[1].q_reference, left_at, 2 * one_step);
  EXPECT_GT(rig.out->record.joints[0].q_reference, other_left_at + 4 * one_step) << "the others go on";
}

// A drive that follows positions with gains of its own: everything but where it was told to be last would be a jump.
TEST(LateSetpoint, APositionDriveStaysWhereItWasToldToBe) {
  TickConfig config = robot(3);
  config.joints[1].loop = LoopAt::drive_position;
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(200, 1.0F);
  const float told = rig.out->setpoints[1].q;
  rig.tick_with_policy(1.0F);
  EXPECT_NEAR(rig.out->damping[1].q, told, 1e-5F);
  EXPECT_GT(std::abs(told - rig.out->record.joints[1].q_estimate), 0.01F) << "it trails behind";
  EXPECT_GT(rig.out->damping[1].kp, 0.0F) << "none would be no target";
}

// The slew of the next tick begins where the damping ended, not at a torque that no drive produced.
TEST(LateSetpoint, TheSlewGoesOnFromWhatWasSent) {
  Rig rig = moving_rig();
  const float slew = rig.config.joints[1].limits.torque_rate * 0.001F;
  int telling = 0;
  for (int i = 0; i < 600; ++i) {
    rig.late = i % 3 == 0 ? 0b010 : 0;
    rig.tick_with_policy(i % 60 < 30 ? 1.2F : -1.0F);
    const bool damped = rig.late != 0;
    const float decided = rig.out->record.joints[1].tau_total;
    const float sent = damped ? torque_of(rig.out->damping[1], rig.out->record.joints[1]) : decided;
    rig.late = 0;
    rig.tick_with_policy(i % 60 < 30 ? 1.2F : -1.0F);
    ASSERT_EQ(rig.header().last_damped, damped ? 0b010U : 0U);
    const float next = rig.out->record.joints[1].tau_total;
    ASSERT_LE(std::abs(next - sent), slew * 1.001F + 1e-4F);
    telling += std::abs(decided - sent) > 0.5F * slew ? 1 : 0;
  }
  EXPECT_GT(telling, 20) << "what was sent hardly ever differed: this test sees nothing";
}

TEST(LateSetpoint, MayLeaveForOnePeriodOrUntilItsCommandDies) {
  Rig rig = moving_rig();
  rig.tick_with_policy(1.0F);
  EXPECT_EQ(rig.out->send_by, rig.header().now + rig.config.period);
  bool shorter = false;
  while (rig.header().seats[Seat::policy].freshness != Freshness::stale &&
         rig.header().seats[Seat::policy].freshness != Freshness::missing) {
    const MonoTime dies_at =
        rig.sensed_at[rig.header().seats[Seat::policy].observation_answered] + rig.config.freshness.max_age;
    ASSERT_EQ(rig.out->send_by, std::min(rig.header().now + rig.config.period, dies_at));
    ASSERT_EQ(rig.out->valid_until, dies_at);
    shorter |= rig.out->send_by < rig.header().now + rig.config.period;
    rig.tick();
  }
  EXPECT_TRUE(shorter);
  EXPECT_FALSE(rig.out->valid_until.is_set());
  EXPECT_EQ(rig.out->send_by, rig.header().now + rig.config.period) << "no command is behind it";
}

// What drives are told ends with the chunk, when that is sooner than the age.
TEST(LateSetpoint, ACommandAlsoDiesAtTheEndOfItsChunk) {
  Rig rig = moving_rig();
  while (!rig.out->observation_due) rig.tick();
  const MonoTime observed_at = rig.published_at[rig.newest_observation];
  const CommandChunk chunk =
      testing::chunk_for(rig.config, rig.newest_observation, observed_at, rig.now, ++rig.sequence, 1.0F, 3);
  rig.tick(&chunk);
  ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  EXPECT_EQ(rig.out->valid_until, observed_at + milliseconds(30));
}

}  // namespace
}  // namespace takt::pipeline
