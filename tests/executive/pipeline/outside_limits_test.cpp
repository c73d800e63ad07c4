// SPDX-License-Identifier: Apache-2.0
// Goal: a joint found outside its position limits, but inside the margin, is left where it is by a stop, and returns
// by the reference's own limits when tracking begins: nothing throws it back.
// Method: the rig's joint, pushed by hand to 0.13 of the 0.15 rad beyond either limit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "executive/pipeline/reference_limits.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

class OutsideLimits : public ::testing::TestWithParam<float> {
 protected:
  OutsideLimits() : rig(configure()) {}
  static TickConfig configure() {
    TickConfig config = robot(1);
    config.resume_over = seconds(3);
    config.degraded_speed_scale = 0.15F;
    return config;
  }
  // +1 beyond q_max, -1 beyond q_min.
  [[nodiscard]] float side() const { return GetParam(); }
  [[nodiscard]] float limit() const {
    return side() > 0 ? rig.config.joints[0].limits.q_max : rig.config.joints[0].limits.q_min;
  }
  // At half a radian per second, from wherever it is, and let go.
  void push_by_hand(float beyond) {
    const float end = limit() + side() * beyond;
    float q = rig.drives[0].q;
    while (side() * q < side() * end) {
      q += side() * 0.0005F;
      rig.drives[0].q = q;
      rig.drives[0].dq = side() * 0.5F;
      rig.tick_with_policy(side());
    }
    rig.drives[0].q = end;
    rig.drives[0].dq = 0;
  }
  Rig rig;
};

TEST_P(OutsideLimits, ADampedStopLeavesItWhereItIs) {
  rig.arm(side());
  rig.run_with_policy(1000, side());
  rig.tick_with_policy(side(), OperatorRequest::stop);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  push_by_hand(0.13F);
  const float where = rig.drives[0].q;
  float fastest = 0;
  for (int i = 0; i < 3000; ++i) {
    rig.tick();
    if (i > 40) fastest = std::max(fastest, std::abs(rig.drives[0].dq));  // the hand is still in the estimate
  }
  EXPECT_GT(rig.out->setpoints[0].kp, 0.0F) << "at rest, held";
  EXPECT_LT(fastest, 0.1F);
  EXPECT_NEAR(rig.drives[0].q, where, 0.02F);
}

TEST_P(OutsideLimits, BeyondTheMarginAStopDampsAndDoesNotFetchIt) {
  rig.arm(side());
  rig.run_with_policy(1000, side());
  push_by_hand(0.3F);
  const float where = rig.drives[0].q;
  float fastest = 0;
  for (int i = 0; i < 3000; ++i) {
    rig.tick();
    if (i > 40) fastest = std::max(fastest, std::abs(rig.drives[0].dq));
  }
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_LT(fastest, 0.1F);
  EXPECT_NEAR(rig.drives[0].q, where, 0.03F);
  EXPECT_EQ(rig.out->setpoints[0].kp, 0.0F);
}

TEST_P(OutsideLimits, ArmingReturnsItAtThePaceOfTheRamp) {
  push_by_hand(0.13F);
  rig.arm(side());
  ASSERT_EQ(rig.mode(), Mode::tracking);
  EXPECT_NEAR(rig.out->record.joints[0].q_reference, limit() + side() * 0.13F, 0.005F) << "starts where it is";
  const JointLimits& limits = rig.config.joints[0].limits;
  float fastest = 0, hardest = 0, before = rig.drives[0].dq, reference_before = rig.out->record.joints[0].dq_reference;
  for (int i = 0; i < 2000; ++i) {
    rig.tick_with_policy(side());
    const JointRecord& joint = rig.out->record.joints[0];
    const float ramp = 0.15F + 0.85F * static_cast<float>(i + 20) / 3000.0F;
    ASSERT_LE(std::abs(joint.dq_reference), ramp * limits.velocity + 1e-3F) << i;
    ASSERT_LE(std::abs(joint.dq_reference - reference_before), limits.acceleration * 0.00101F) << i;
    reference_before = joint.dq_reference;
    fastest = std::max(fastest, std::abs(rig.drives[0].dq));
    hardest = std::max(hardest, std::abs(rig.drives[0].dq - before) / 0.001F);
    before = rig.drives[0].dq;
  }
  EXPECT_NEAR(rig.drives[0].q, side(), 0.02F);
  EXPECT_LT(fastest, 1.2F * (0.15F + 0.85F * 2.0F / 3.0F) * limits.velocity);
  EXPECT_LT(hardest, 2.0F * limits.acceleration) << "the joint follows its reference, not a barrier";
}

INSTANTIATE_TEST_SUITE_P(EitherSide, OutsideLimits, ::testing::Values(1.0F, -1.0F),
                         [](const auto& side) { return side.param > 0 ? "above" : "below"; });

TEST(ReferenceOutside, ReturnsInsideItsLimitsAndNeverMovesOut) {
  const JointLimits limits = robot(1).joints[0].limits;
  for (const double side : {1.0, -1.0}) {
    ReferenceState at = standing_at(static_cast<float>(side * 1.5), limits);
    const ReferenceState start = at;
    EXPECT_DOUBLE_EQ(step_braking(at, limits, 0.001).next.q, at.q) << "at rest it stays";
    EXPECT_LE(step_towards(at, static_cast<float>(side * 9), 0, 3, limits, 0.001).next.q * side, start.q * side)
        << "not further out";
    for (int i = 0; i < 3000; ++i) {
      const ReferenceState next = step_towards(at, 0, 0, 1, limits, 0.001).next;
      ASSERT_LE(next.q * side, at.q * side + 1e-12);
      ASSERT_LE(std::abs(next.dq), 1.0 + 1e-9);
      ASSERT_LE(std::abs(next.dq - at.dq), limits.acceleration * 0.001 * 1.0001);
      at = next;
    }
    EXPECT_NEAR(at.q, 0, 1e-6);
  }
}

}  // namespace
}  // namespace takt::pipeline
