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
                                                .barriers = true},
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
  const TorqueRange range = barrier_range({kJoint.limits.q_max, 0.0F}, kJoint);
  EXPECT_LT(range.low, 0.0F);
  EXPECT_GT(range.high, 5.0F);
}

TEST(Barriers, PushBackFromBeyondTheLimit) {
  EXPECT_LT(barrier_range({kJoint.limits.q_max + 0.1F, 0.0F}, kJoint).high, 0.0F);
  EXPECT_GT(barrier_range({kJoint.limits.q_min - 0.1F, 0.0F}, kJoint).low, 0.0F);
}

TEST(Barriers, NameWhatBinds) {
  const auto marks = [](JointMotion measured, float torque) {
    return stabilise_joint({.measured = measured, .tau_ff = torque, .tau_last = torque, .barriers = true}, kJoint, kDt)
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
  const TorqueRange range = barrier_range({uniform(-50, 50), uniform(-50, 50)}, joint);
  RC_ASSERT(range.low <= range.high);
}

// A torque of full strength towards the limit, from anywhere inside: the joint must stay inside the hard envelope.
TEST(Barriers, AHostileTorqueCannotDriveTheJointOutOfTheHardEnvelope) {
  for (const float direction : {1.0F, -1.0F}) {
    for (const float factor : {1.0F, 2.0F}) {  // true inertia over its lower bound
      float q = 0, dq = 0, tau_last = 0, farthest = 0, fastest = 0;
      for (int i = 0; i < 4000; ++i) {
        const StabiliserOutput out = stabilise_joint(
            {.measured = {q, dq}, .tau_ff = 30.0F * direction, .tau_last = tau_last, .barriers = true}, kJoint, kDt);
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

TEST(Envelope, CatchesWhatABrokenStageLetsThrough) {
  const JointLimits& limits = kJoint.limits;
  const JointSetpoint sound{0.1F, 0.1F, 50, 1, 1};
  const auto verdict = [&](JointSetpoint setpoint, float q = 0.0F) {
    float total = 0;
    const EnvelopeVerdict result = clamp_to_envelope(setpoint, total, q, 0.0F, limits);
    EXPECT_LE(std::abs(total), limits.torque * 1.0011F);
    EXPECT_TRUE(setpoint.q >= limits.q_min || result == EnvelopeVerdict::not_finite);
    EXPECT_LE(std::abs(drive_torque(setpoint, {q, 0})), limits.torque * 1.0011F);
    return result;
  };
  EXPECT_EQ(verdict(sound), EnvelopeVerdict::inside);
  EXPECT_EQ(verdict({1.6F, 0, 1, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 3.5F, 0, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, -1, 0, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, 0, 7, 0}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({0, 0, 0, 0, 31}), EnvelopeVerdict::clamped);
  EXPECT_EQ(verdict({1, 0, 200, 0, 0}, -1), EnvelopeVerdict::clamped) << "400 Nm at this position";
  EXPECT_EQ(verdict({NAN, 0, 0, 0, 0}), EnvelopeVerdict::not_finite);
  EXPECT_EQ(verdict({0, 0, 0, INFINITY, 0}), EnvelopeVerdict::not_finite);
}

}  // namespace
}  // namespace takt::pipeline
