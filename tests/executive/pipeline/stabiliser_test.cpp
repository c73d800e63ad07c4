// SPDX-License-Identifier: Apache-2.0
// Goal: the drive's fields always produce the limited torque and stay inside their own limits; barriers act on the
// measured state before the hard envelope; the last clamp catches what a broken stage would let through.
// Method: hand-worked cases, random inputs, and a simulated joint pushed towards its limit by a hostile torque.
#include "executive/pipeline/stabiliser.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "executive/pipeline/envelope.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

constexpr float kDt = 0.001F;
const JointConfig kJoint = testing::robot(1).joints[0];
const float kBarrier = speed_barrier_of_play(kJoint.limits);

float drive_torque(const JointSetpoint& s, const JointMotion& at) {
  return s.kp * (s.q - at.q) + s.kd * (s.dq - at.dq) + s.tau;
}

TEST(Stabiliser, WithoutNeedItPassesTheImpedanceToTheDrive) {
  const StabiliserOutput out = stabilise_joint({.reference = {0.5F, 0.1F},
                                                .measured = {0.49F, 0.0F},
                                                .kp = 100,
                                                .kd = 3,
                                                .tau_ff = 1,
                                                .gravity = 2,
                                                .tau_last = 4,
                                                .barriers = true,
                                                .speed_barrier = kBarrier},
                                               kJoint, kDt);
  EXPECT_EQ(out.interventions, 0);
  EXPECT_EQ(out.setpoint.q, 0.5F);
  EXPECT_EQ(out.setpoint.dq, 0.1F);
  EXPECT_EQ(out.setpoint.kp, 100.0F);
  EXPECT_EQ(out.setpoint.kd, 3.0F);
  EXPECT_EQ(out.setpoint.tau, 3.0F);
  EXPECT_NEAR(out.tau_total, 100 * 0.01F + 3 * 0.1F + 3, 1e-4F);
}

TEST(Stabiliser, SlewStartsFromThePreviousTorque) {
  const StabiliserOutput out =
      stabilise_joint({.reference = {0.1F, 0}, .measured = {}, .kp = 100, .kd = 3}, kJoint, kDt);
  EXPECT_EQ(out.interventions, bit(Intervention::torque_rate_limit));
  EXPECT_NEAR(out.tau_total, 3.0F, 1e-5F) << "3000 Nm/s for 1 ms";
  EXPECT_EQ(out.setpoint.kp, 100.0F) << "feed-forward absorbs it, stiffness stays";
}

TEST(Stabiliser, GainsBeyondTheirMaximumAreClampedAndSaid) {
  const StabiliserOutput out = stabilise_joint({.kp = 390, .kd = 11}, kJoint, kDt);
  EXPECT_EQ(out.interventions, bit(Intervention::gain_limit));
  EXPECT_EQ(out.setpoint.kp, kJoint.limits.kp_max);
  EXPECT_EQ(out.setpoint.kd, kJoint.limits.kd_max);
}

RC_GTEST_PROP(Stabiliser, TheDriveProducesTheLimitedTorqueFromFieldsInsideTheirLimits, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto uniform = [&random](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  const JointLimits& limits = kJoint.limits;
  StabiliserInput in;
  in.reference = {uniform(limits.q_min, limits.q_max), uniform(-limits.velocity, limits.velocity)};
  in.measured = {uniform(-2.0F, 2.0F), uniform(-10.0F, 10.0F)};
  in.kp = uniform(0, 400);
  in.kd = uniform(0, 12);
  in.tau_ff = uniform(-30, 30);
  in.gravity = uniform(-60, 60);
  in.tau_last = uniform(-30, 30);
  in.barriers = random() % 2 == 0;
  in.speed_barrier = kBarrier;
  const StabiliserOutput out = stabilise_joint(in, kJoint, kDt);
  const float produced = drive_torque(out.setpoint, in.measured);
  const float rounding = 1e-3F * limits.torque;
  RC_ASSERT(std::abs(produced - out.tau_total) <= rounding);
  RC_ASSERT(std::abs(produced) <= limits.torque + rounding);
  RC_ASSERT(std::abs(produced - in.tau_last) <= limits.torque_rate * kDt + rounding);
  JointSetpoint clamped = out.setpoint;
  float total = 0;
  RC_ASSERT(clamp_to_envelope(clamped, total, in.measured.q, in.measured.dq, limits) == EnvelopeVerdict::inside);
}

TEST(Barriers, LeaveAReferenceAtItsLimitAlone) {
  const TorqueRange range = barrier_range({kJoint.limits.q_max, 0.0F}, 0.0F, kBarrier, kJoint);
  EXPECT_LT(range.low, 0.0F);
  EXPECT_GT(range.high, 5.0F);
}

TEST(Barriers, PushBackFromBeyondTheLimit) {
  EXPECT_LT(barrier_range({kJoint.limits.q_max + 0.1F, 0.0F}, 0.0F, kBarrier, kJoint).high, 0.0F);
  EXPECT_GT(barrier_range({kJoint.limits.q_min - 0.1F, 0.0F}, 0.0F, kBarrier, kJoint).low, 0.0F);
}

TEST(Barriers, LetAJointStayWhereItMayAndGoNoFurther) {
  for (const float q : {kJoint.limits.q_max + 0.1F, kJoint.limits.q_min - 0.1F}) {
    const TorqueRange still = barrier_range({q, 0.0F}, q, kBarrier, kJoint);
    EXPECT_LE(still.low, 0.0F);
    EXPECT_GE(still.high, 0.0F);
    const float outwards = q > 0 ? 1.0F : -1.0F;
    const TorqueRange moving = barrier_range({q, outwards}, q, kBarrier, kJoint);
    EXPECT_LT(outwards > 0 ? moving.high : -moving.low, 0.0F) << "outwards it is braked";
  }
}

TEST(Barriers, NameWhatBinds) {
  const auto marks = [](JointMotion measured, float torque) {
    return stabilise_joint({.measured = measured,
                            .tau_ff = torque,
                            .tau_last = torque,
                            .barriers = true,
                            .speed_barrier = kBarrier},
                           kJoint, kDt)
        .interventions;
  };
  EXPECT_TRUE(marks({0.0F, 5.4F}, 20.0F) & bit(Intervention::velocity_barrier));
  EXPECT_TRUE(marks({0.0F, -5.4F}, -20.0F) & bit(Intervention::velocity_barrier));
  EXPECT_TRUE(marks({kJoint.limits.q_max + 0.05F, 0.5F}, 5.0F) & bit(Intervention::position_barrier));
  EXPECT_TRUE(marks({kJoint.limits.q_min - 0.05F, -0.5F}, -5.0F) & bit(Intervention::position_barrier));
}

RC_GTEST_PROP(Barriers, ARangeIsNeverEmpty, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto uniform = [&random](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  JointConfig joint = kJoint;
  joint.limits.q_min = uniform(-1, 0);
  joint.limits.q_max = joint.limits.q_min + uniform(1e-3F, 1);
  const TorqueRange range =
      barrier_range({uniform(-50, 50), uniform(-50, 50)}, uniform(-50, 50), speed_barrier_of_play(joint.limits), joint);
  RC_ASSERT(range.low <= range.high);
}

// A torque of full strength towards the limit, from anywhere inside: the joint must stay inside the hard envelope.
TEST(Barriers, AHostileTorqueCannotDriveTheJointOutOfTheHardEnvelope) {
  for (const float direction : {1.0F, -1.0F}) {
    for (const float factor : {1.0F, 2.0F}) {  // true inertia over its lower bound
      float q = 0, dq = 0, tau_last = 0, farthest = 0, fastest = 0;
      for (int i = 0; i < 4000; ++i) {
        const StabiliserOutput out = stabilise_joint({.measured = {q, dq},
                                                      .tau_ff = 30.0F * direction,
                                                      .tau_last = tau_last,
                                                      .barriers = true,
                                                      .speed_barrier = kBarrier},
                                                     kJoint, kDt);
        tau_last = out.tau_total;
        dq += kDt * drive_torque(out.setpoint, {q, dq}) / (factor * kJoint.inertia);
        q += kDt * dq;
        farthest = std::max(farthest, direction * q);
        fastest = std::max(fastest, std::abs(dq));
      }
      const float limit = direction > 0 ? kJoint.limits.q_max : -kJoint.limits.q_min;
      EXPECT_LE(farthest, limit + kJoint.limits.q_hard_margin) << "direction " << direction << " factor " << factor;
      EXPECT_GE(farthest, limit) << "the whole range stays usable";
      EXPECT_LE(fastest, kJoint.limits.velocity_hard);
    }
  }
}

// Goal: for a drive that takes a torque, what leaves is the limited torque itself: no driver has a law or a limit.
// Method: the same random demands; the drive produces tau and nothing else.
RC_GTEST_PROP(Stabiliser, AHostTorqueIsFinishedAndLimited, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto uniform = [&random](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
  };
  JointConfig joint = kJoint;
  const StabiliserInput in{.reference = {uniform(-1, 1), uniform(-2, 2)},
                           .measured = {uniform(-2, 2), uniform(-10, 10)},
                           .kp = uniform(0, 400),
                           .kd = uniform(0, 12),
                           .tau_ff = uniform(-30, 30),
                           .gravity = uniform(-60, 60),
                           .tau_last = uniform(-30, 30),
                           .barriers = random() % 2 == 0,
                           .speed_barrier = speed_barrier_of_play(joint.limits)};
  const float by_the_drive = drive_torque(stabilise_joint(in, joint, kDt).setpoint, in.measured);
  joint.loop = LoopAt::host_torque;
  const StabiliserOutput out = stabilise_joint(in, joint, kDt);
  RC_ASSERT(out.setpoint.kp == 0.0F && out.setpoint.kd == 0.0F);
  RC_ASSERT(out.setpoint.tau == out.tau_total);
  RC_ASSERT(std::abs(out.tau_total) <= joint.limits.torque);
  RC_ASSERT(std::abs(out.tau_total - in.tau_last) <= joint.limits.torque_rate * kDt * 1.0001F ||
            std::abs(in.tau_last) > joint.limits.torque);
  RC_ASSERT(std::abs(out.tau_total - by_the_drive) <= 1e-3F * joint.limits.torque);
}

// Worked out by hand: 0.25 + 10 / 2 (0.7 - 0.5) = 1.25 rad/s.
TEST(Stabiliser, AHostVelocityClosesErrorsAtTheRatioOfTheGains) {
  JointConfig joint = kJoint;
  joint.loop = LoopAt::host_velocity;
  const auto velocity = [&joint](const StabiliserInput& in) {
    const StabiliserOutput out = stabilise_joint(in, joint, kDt);
    EXPECT_EQ(out.setpoint.kp, 0.0F);
    EXPECT_EQ(out.setpoint.kd, 0.0F);
    EXPECT_EQ(out.setpoint.tau, 0.0F);
    EXPECT_EQ(out.tau_total, 0.0F);
    return out.setpoint.dq;
  };
  EXPECT_NEAR(velocity({.reference = {0.7F, 0.25F}, .measured = {0.5F, 1}, .kp = 10, .kd = 2}), 1.25, 1e-6);
  EXPECT_EQ(velocity({.reference = {1, 0}, .measured = {-1, 0}, .kp = 100, .kd = 2}), 3.0F) << "the limit";
  EXPECT_EQ(velocity({.reference = {1, 3}, .measured = {}, .kp = 10}), 0.0F) << "no damping was asked for";
  EXPECT_EQ(velocity({.reference = {1, 0}, .measured = {0.2F, 1}, .kd = 3}), 0.0F) << "a damped stop";
  EXPECT_EQ(velocity({.reference = {0, 0}, .measured = {0, 0}, .kp = 10, .kd = 1e-38F}), 0.0F);
  EXPECT_EQ(velocity({.reference = {1, 0}, .measured = {0, 0}, .kp = 10, .kd = 1e-38F}), 3.0F) << "not a NaN";
  const StabiliserInput beyond{.reference = {1.4F, 2},
                               .measured = {1.475F, 0},
                               .kp = 0,
                               .kd = 2,
                               .barriers = true,
                               .may_stay_at = 1.4F,
                               .speed_barrier = kBarrier};
  EXPECT_EQ(velocity(beyond), 0.0F) << "at its position barrier";
}

// What scales 0..1 of the drive's own gains cannot say goes into the torque: all damping at zero stiffness, for one.
TEST(Stabiliser, GainsThatTheDriveCannotSayBecomeTorque) {
  JointConfig joint = kJoint;
  joint.drive_gains = {.kp = 20, .kd = 1};
  const JointMotion measured{0.1F, 0.5F};
  const auto made = [&](float kp, float kd, float tau_ff) {
    const StabiliserInput in{.reference = {0.2F, 0},
                             .measured = measured,
                             .kp = kp,
                             .kd = kd,
                             .tau_ff = tau_ff,
                             .tau_last = kp * 0.1F - kd * 0.5F + tau_ff};
    const StabiliserOutput out = stabilise_joint(in, joint, kDt);
    EXPECT_NEAR(drive_torque(out.setpoint, measured), in.tau_last, 1e-5F) << "the same torque";
    EXPECT_EQ(out.interventions, 0);
    return out.setpoint;
  };
  const JointSetpoint damping = made(0, 0.5F, 0.25F);
  EXPECT_EQ(damping.kp, 0.0F);
  EXPECT_EQ(damping.kd, 0.0F);
  const JointSetpoint stiff = made(50, 0, 0);
  EXPECT_EQ(stiff.kp, 20.0F);
  const JointSetpoint damped = made(4, 1.5F, 0);
  EXPECT_FLOAT_EQ(damped.kp, 4.0F);
  EXPECT_FLOAT_EQ(damped.kd, 0.2F) << "no larger a share than the stiffness has";
  const JointSetpoint within = made(10, 0.5F, 1);
  EXPECT_EQ(within.kd, 0.5F);
  EXPECT_EQ(within.tau, 1.0F);
}

TEST(Envelope, CatchesWhatABrokenStageLetsThrough) {
  const JointLimits& limits = kJoint.limits;
  const JointSetpoint sound{0.1F, 0.1F, 50, 1, 1};
  const auto verdict = [&](JointSetpoint setpoint, float q = 0.0F) {
    float total = 0;
    const EnvelopeVerdict result = clamp_to_envelope(setpoint, total, q, 0.0F, limits);
    EXPECT_LE(std::abs(total), limits.torque * 1.0011F);
    EXPECT_TRUE(result != EnvelopeVerdict::not_finite || total == 0.0F);
    EXPECT_TRUE(setpoint.q >= limits.q_min || result == EnvelopeVerdict::not_finite);
    EXPECT_LE(std::abs(drive_torque(setpoint, {q, 0})), limits.torque * 1.0011F);
    return result;
  };
  EXPECT_EQ(verdict(sound), EnvelopeVerdict::inside);
  EXPECT_EQ(verdict({1.6F, 0, 1, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 3.5F, 0, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, -1, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, -0.1F, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, 0, -0.1F, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, 0, 7, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, 0, 0, 31}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({1, 0, 200, 0, 0}, -1), EnvelopeVerdict::clamped) << "400 Nm at this position";
  EXPECT_EQ(verdict({NAN, 0, 0, 0, 0}), EnvelopeVerdict::not_finite);
  EXPECT_EQ(verdict({0, 0, 0, INFINITY, 0}), EnvelopeVerdict::not_finite);
}

}  // namespace
}  // namespace takt::pipeline
