// SPDX-License-Identifier: Apache-2.0
// Goal: a robot that falls without a controller keeps one when its policy is late, and what nothing can drive is never
// driven. Method: the rig's robot with a passive joint; the law against the recorded estimates tick by tick; a pole on
// a cart in three lines of physics, balanced by state feedback and dropped by holding; every mode for the passive
// joint.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "executive/pipeline/reference_limits.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;

// The last joint is passive; gains differ from entry to entry.
TickConfig balancing_robot(std::uint32_t joints) {
  TickConfig config = testing::robot(joints);
  config.degraded = DegradedBehaviour::fallback;
  config.fallback = FallbackKind::state_feedback;
  config.freshness.stop_after = seconds(60);
  JointConfig& passive = config.joints[joints - 1];
  const JointLimits& limits = passive.limits;
  passive = {.limits = {.q_min = limits.q_min,
                        .q_max = limits.q_max,
                        .velocity = limits.velocity,
                        .q_hard_margin = limits.q_hard_margin,
                        .velocity_hard = limits.velocity_hard},
             .inertia = 0.1F,  // for the rig's physics
             .fallback_pose = 0.1F,
             .observer_bandwidth = 200.0F,
             .passive = true};
  for (std::uint32_t j = 0; j + 1 < joints; ++j)
    for (std::uint32_t k = 0; k < joints; ++k)
      config.feedback_gains[j][k] = {j == k ? 2.0F : -0.3F, j == k ? 0.5F : 0.1F * static_cast<float>(k)};
  return config;
}

void degrade(Rig& rig) {
  rig.arm(-0.4F);
  ASSERT_EQ(rig.mode(), Mode::tracking);
  rig.run_with_policy(1000, -0.4F);
  for (int i = 0; i < 300 && rig.mode() != Mode::degraded; ++i) rig.tick();
  ASSERT_EQ(rig.mode(), Mode::degraded);
}

bool asks_for_nothing(const JointSetpoint& setpoint) {
  return setpoint.dq == 0 && setpoint.kp == 0 && setpoint.kd == 0 && setpoint.tau == 0;
}

TEST(StateFeedback, TorqueIsMinusGainsTimesDeviation) {
  const TickConfig config = balancing_robot(3);
  Rig rig(config);
  degrade(rig);
  for (int i = 0; i < 20; ++i) rig.tick();  // past the slew from the torque of tracking
  float largest = 0;
  for (int i = 0; i < 500; ++i) {
    rig.tick();
    for (std::size_t j = 0; j < 2; ++j) {
      float expected = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const JointRecord& joint = rig.out->record.joints[k];
        expected -= config.feedback_gains[j][k].position * (joint.q_estimate - config.joints[k].fallback_pose) +
                    config.feedback_gains[j][k].velocity * joint.dq_estimate;
      }
      EXPECT_NEAR(rig.out->setpoints[j].tau, expected, 1e-4F) << "joint " << j << ", tick " << i;
      EXPECT_EQ(rig.out->setpoints[j].kp, 0.0F);
      EXPECT_EQ(rig.out->setpoints[j].kd, 0.0F);
      largest = std::max(largest, std::abs(expected));
    }
    EXPECT_TRUE(asks_for_nothing(rig.out->setpoints[2])) << "tick " << i;
  }
  EXPECT_GT(largest, 0.3F) << "there was something to do";
}

TEST(StateFeedback, StaysInsideTorqueSlewAndBarriers) {
  TickConfig config = balancing_robot(2);
  config.feedback_gains[0][0] = {5000.0F, 0.0F};
  Rig rig(config);
  degrade(rig);
  float before = rig.out->record.joints[0].tau_total;
  InterventionMask seen = 0;
  for (int i = 0; i < 400; ++i) {
    rig.tick();
    const JointRecord& joint = rig.out->record.joints[0];
    EXPECT_LE(std::abs(joint.tau_total), config.joints[0].limits.torque * 1.001F);
    EXPECT_LE(std::abs(joint.tau_total - before), config.joints[0].limits.torque_rate * 0.001F * 1.01F);
    EXPECT_LE(std::abs(joint.dq_estimate), config.joints[0].limits.velocity_hard);
    before = joint.tau_total;
    seen = static_cast<InterventionMask>(seen | joint.interventions);
  }
  EXPECT_NE(seen & bit(Intervention::torque_rate_limit), 0);
  EXPECT_NE(seen & bit(Intervention::velocity_barrier), 0);
  EXPECT_EQ(seen & bit(Intervention::envelope_clamp), 0) << "the last clamp had nothing to do";
}

TEST(StateFeedback, TrackingResumesFromTheMotionThatItLeaves) {
  TickConfig config = balancing_robot(2);
  config.feedback_gains[0][0] = {6.0F, 0.2F};
  config.freshness.recover_after = milliseconds(40);
  Rig rig(config);
  degrade(rig);
  for (int i = 0; i < 60; ++i) rig.tick();
  ASSERT_GT(std::abs(rig.drives[0].dq), 0.3F) << "it is in motion";
  for (int i = 0; i < 300 && rig.mode() == Mode::degraded; ++i) {
    const JointRecord last = rig.out->record.joints[0];
    EXPECT_FLOAT_EQ(last.q_reference, last.q_estimate);
    EXPECT_FLOAT_EQ(last.dq_reference, last.dq_estimate);
    rig.tick_with_policy(-0.4F);
  }
  ASSERT_EQ(rig.mode(), Mode::tracking);
  const JointRecord& joint = rig.out->record.joints[0];
  EXPECT_NEAR(joint.q_reference, joint.q_estimate, 0.01F);
  EXPECT_NEAR(joint.dq_reference, joint.dq_estimate, 3 * config.joints[0].limits.acceleration * 0.001F);
}

// A pole on a cart whose pulley is joint 0: dd(pole) = grow^2 pole - push * torque of the cart.
struct Pole {
  float angle = 0.03F, speed = 0;
  void step(Rig& rig) {
    constexpr float kGrow = 4.0F, kPush = 0.8F, kDt = 0.001F;
    speed += kDt * (kGrow * kGrow * angle - kPush * rig.drives[0].tau);
    angle += kDt * speed;
    rig.drives[1].q = angle;
    rig.drives[1].dq = speed;
  }
};

float farthest_lean(TickConfig config, int ticks) {
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(1000, 0.0F);
  Pole pole;
  float farthest = 0;
  for (int i = 0; i < ticks; ++i) {
    pole.step(rig);
    rig.tick();
    if (rig.mode() == Mode::damped_stop) return 100.0F;
    farthest = std::max(farthest, std::abs(pole.angle));
  }
  return farthest;
}

TEST(StateFeedback, BalancesWhatFallsWithoutIt) {
  TickConfig config = balancing_robot(2);
  config.joints[1].fallback_pose = config.joints[0].fallback_pose = 0;
  // The cart's own terms have the sign that lets it run after the pole first.
  config.feedback_gains[0] = {};
  config.feedback_gains[0][0] = {-1.0F, -1.0F};
  config.feedback_gains[0][1] = {-60.0F, -14.0F};
  EXPECT_LT(farthest_lean(config, 5000), 0.3F);
  config.degraded = DegradedBehaviour::hold;
  EXPECT_EQ(farthest_lean(config, 5000), 100.0F) << "the fallen pole is a stop";
}

TEST(PassiveJoint, GetsNothingInAnyMode) {
  TickConfig config = balancing_robot(2);
  config.degraded = DegradedBehaviour::hold;
  config.freshness.stop_after = milliseconds(400);
  Rig rig(config);
  std::array<bool, kModeCount> seen{};
  const auto look = [&] {
    seen[static_cast<std::size_t>(rig.mode())] = true;
    EXPECT_TRUE(asks_for_nothing(rig.out->setpoints[1])) << name(rig.mode());
    EXPECT_FLOAT_EQ(rig.out->setpoints[1].q, rig.out->record.joints[1].q_estimate) << "its reference is where it is";
  };
  for (int i = 0; i < 40; ++i, look()) rig.tick_with_policy(0.3F);
  rig.tick_with_policy(0.3F, OperatorRequest::arm);
  for (int i = 0; i < 200; ++i, look()) rig.tick_with_policy(0.3F);
  for (int i = 0; i < 1000; ++i, look()) {
    rig.drives[1].dq = 0.5F;  // a hand moves it
    rig.tick();
  }
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  rig.drives[0].fault = true;
  for (int i = 0; i < 10; ++i, look()) rig.tick();
  for (const Mode mode :
       {Mode::standby, Mode::arming, Mode::tracking, Mode::degraded, Mode::damped_stop, Mode::fault_latched})
    EXPECT_TRUE(seen[static_cast<std::size_t>(mode)]) << name(mode);
}

TEST(PassiveJoint, ACommandThatAsksForTorqueThereIsOutOfRangeAndGetsNone) {
  const TickConfig config = balancing_robot(2);
  Rig rig(config);
  rig.arm(0.0F);
  while (!rig.out->observation_due) rig.tick_with_policy(0.0F);
  CommandChunk chunk = testing::chunk_for(config, rig.newest_observation, rig.published_at[rig.newest_observation],
                                          rig.now, ++rig.sequence, 0.0F);
  chunk.header.fields = static_cast<std::uint8_t>(CommandField::q) | static_cast<std::uint8_t>(CommandField::tau_ff);
  std::fill_n(chunk.values, chunk.value_count(), 0.0F);
  for (std::size_t step = 0; step < chunk.header.step_count; ++step)
    chunk.values[value_index(chunk.header, CommandField::tau_ff, step, 1)] = 0.5F;
  rig.tick(&chunk);
  ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  EXPECT_NE(rig.out->record.joints[1].interventions & bit(Intervention::target_range), 0);
  EXPECT_EQ(rig.out->setpoints[1].tau, 0.0F);
}

TEST(MovingWith, IsAStateThatCanStillStop) {
  const JointLimits limits = testing::robot(1).joints[0].limits;
  for (float q = -3; q <= 3; q += 0.05F) {
    for (float dq = -20; dq <= 20; dq += 0.5F) {
      ReferenceState state = moving_with(q, dq, limits, 0.001);
      EXPECT_LE(std::abs(state.dq), static_cast<double>(limits.velocity));
      EXPECT_GE(state.dq * static_cast<double>(dq), 0.0);
      for (int i = 0; i < 500; ++i) {
        const ReferenceState next = step_braking(state, limits, 0.001).next;
        ASSERT_LE(std::abs(next.dq - state.dq), static_cast<double>(limits.acceleration) * 0.001 * 1.0001)
            << "from q " << q << " dq " << dq;
        state = next;
        const double margin = limits.q_hard_margin;
        ASSERT_GE(state.q, std::max(double{limits.q_min} - margin, std::min<double>(q, limits.q_min)) - 1e-6);
        ASSERT_LE(state.q, std::min(double{limits.q_max} + margin, std::max<double>(q, limits.q_max)) + 1e-6);
      }
    }
  }
}

}  // namespace
}  // namespace takt::pipeline
