// SPDX-License-Identifier: Apache-2.0
// Goal: whatever targets come, the reference never leaves position, velocity and acceleration limits, and there is
// always an admissible next step. Method: random limits, admissible starts and target sequences; the stopping distance
// is checked against braking step by step.
#include "executive/pipeline/reference_limits.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

namespace takt::pipeline {
namespace {

constexpr double kDt = 0.001;

float uniform(std::mt19937& random, float low, float high) {
  return std::uniform_real_distribution<float>(low, high)(random);
}

JointLimits random_limits(std::mt19937& random) {
  JointLimits limits;
  limits.q_min = uniform(random, -6.0F, 0.0F);
  limits.q_max = limits.q_min + uniform(random, 0.001F, 6.0F);
  limits.velocity = std::exp(uniform(random, -3.0F, 3.0F));
  limits.acceleration = std::exp(uniform(random, -1.0F, 6.0F));
  return limits;
}

// Any state of the safe set: inside, and able to stop.
ReferenceState random_admissible(std::mt19937& random, const JointLimits& limits) {
  const double q = static_cast<double>(uniform(random, limits.q_min, limits.q_max));
  const bool up = uniform(random, 0.0F, 1.0F) < 0.5F;
  const double room = up ? static_cast<double>(limits.q_max) - q : q - static_cast<double>(limits.q_min);
  const double fastest = std::min(static_cast<double>(limits.velocity),
                                  stopping_speed(std::max(room, 0.0), static_cast<double>(limits.acceleration), kDt));
  return {q, (up ? 1.0 : -1.0) * static_cast<double>(uniform(random, 0.0F, 1.0F)) * fastest};
}

float random_target(std::mt19937& random, const JointLimits& limits) {
  switch (random() % 4) {
    case 0:
      return uniform(random, limits.q_min, limits.q_max);
    case 1:
      return random() % 2 == 0 ? limits.q_min : limits.q_max;
    case 2:
      return uniform(random, -100.0F, 100.0F);
    default:
      return random() % 2 == 0 ? 3.0e38F : -3.0e38F;
  }
}

RC_GTEST_PROP(ReferenceLimits, TheSafeSetIsNeverLeft, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const JointLimits limits = random_limits(random);
  ReferenceState state = random_admissible(random, limits);
  const double q_min = static_cast<double>(limits.q_min), q_max = static_cast<double>(limits.q_max);
  const double acceleration = static_cast<double>(limits.acceleration);
  float target = 0, path = 0, speed = limits.velocity;
  for (int i = 0; i < 2000; ++i) {
    if (random() % 50 == 0) target = random_target(random, limits);
    if (random() % 90 == 0) path = uniform(random, -2.0F, 2.0F) * limits.velocity;
    if (random() % 200 == 0) speed = uniform(random, 0.0F, 1.0F) * limits.velocity;
    const bool brake = random() % 20 == 0;
    const ReferenceStep step =
        brake ? step_braking(state, limits, kDt) : step_towards(state, target, path, speed, limits, kDt);
    RC_ASSERT(step.next.q >= q_min && step.next.q <= q_max);
    RC_ASSERT(std::abs(step.next.dq) <= static_cast<double>(limits.velocity));
    RC_ASSERT(std::abs(step.next.dq - state.dq) <= acceleration * kDt * (1 + 1e-6) + 1e-10);
    RC_ASSERT(std::abs(step.next.q - state.q - step.next.dq * kDt) <= 1e-12);
    const double room = step.next.dq > 0 ? q_max - step.next.q : step.next.q - q_min;
    const double after = std::max(std::abs(step.next.dq) - acceleration * kDt, 0.0);
    RC_ASSERT(stopping_distance(after, acceleration, kDt) <= room + 1e-12);
    state = step.next;
  }
}

RC_GTEST_PROP(ReferenceLimits, StoppingDistanceIsThatOfBrakingStepByStep, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const double a = std::exp(static_cast<double>(uniform(random, -1.0F, 6.0F)));
  const double speed = static_cast<double>(uniform(random, 0.0F, 20.0F));
  double distance = 0;
  for (double v = speed; v > 0; v -= a * 0.001) distance += v * 0.001;
  const double closed = stopping_distance(speed, a, kDt);
  RC_ASSERT(std::abs(closed - distance) <= 1e-9 * (1 + distance));
  RC_ASSERT(std::abs(stopping_speed(closed, a, kDt) - speed) <= 1e-9 * (1 + speed));
}

constexpr JointLimits kLimits{.q_min = -1.0F, .q_max = 1.0F, .velocity = 2.0F, .acceleration = 10.0F};

TEST(ReferenceLimits, ReachesItsTargetWithoutOvershoot) {
  ReferenceState state;
  double farthest = 0;
  int ticks = 0;
  for (; ticks < 2000 && (state.q != 0.8 || state.dq != 0.0); ++ticks) {
    state = step_towards(state, 0.8F, 0.0F, kLimits.velocity, kLimits, kDt).next;
    farthest = std::max(farthest, state.q);
  }
  EXPECT_NEAR(state.q, 0.8, 1e-6);
  EXPECT_LE(farthest, 0.8 + 1e-6);
  // Fastest possible: accelerate for 0.2 s, coast 0.2 s, brake for 0.2 s. A fifth more for a soft arrival.
  ReferenceState again;
  for (int i = 0; i < 720; ++i) again = step_towards(again, 0.8F, 0.0F, kLimits.velocity, kLimits, kDt).next;
  EXPECT_NEAR(again.q, 0.8, 1e-3);
}

// Goal: the pursuit does not ring. Method: targets of every size for slow and nimble joints, at rest and noisy as a
// network's; the acceleration never jumps, does not go from one limit to the other in a tick, and turns round at most
// once on the way to a target that stays.
TEST(ReferenceLimits, ThePursuitDoesNotRing) {
  for (const float acceleration : {5.0F, 15.0F, 200.0F, 2000.0F}) {
    JointLimits limits = kLimits;
    limits.acceleration = acceleration;
    limits.velocity = 4.0F;
    const double most = static_cast<double>(acceleration);
    for (const float target : {1e-4F, 2e-3F, 0.01F, 0.1F, 0.8F}) {
      ReferenceState state;
      int turns = 0;
      for (int i = 0; i < 3000; ++i) {
        const ReferenceState next = step_towards(state, target, 0.0F, limits.velocity, limits, kDt).next;
        EXPECT_LE(std::abs(next.ddq - state.ddq), kFastestPursuit * most * (1 + 1e-6)) << target << ", tick " << i;
        if (next.ddq * state.ddq < 0 && std::abs(next.ddq) > 1e-6 * most) ++turns;
        state = next;
      }
      EXPECT_NEAR(state.q, static_cast<double>(target), 1e-5);
      EXPECT_LE(turns, 1) << "acceleration " << acceleration << ", target " << target;
    }
    std::mt19937 random(5);
    ReferenceState state;
    int saturated = 0;
    for (int i = 0; i < 5000; ++i) {
      const float t = 0.001F * static_cast<float>(i);
      const float target = 0.2F * std::sin(2.0F * t) + uniform(random, -2e-5F, 2e-5F);
      state = step_towards(state, target, 0.4F * std::cos(2.0F * t), limits.velocity, limits, kDt).next;
      if (i > 500 && std::abs(state.ddq) > 0.9 * most) ++saturated;
    }
    EXPECT_EQ(saturated, 0) << "acceleration " << acceleration;
  }
}

// It trails by what the path accelerates: 2 rad/s^2 over 4 k^2 = 2000 /s^2.
TEST(ReferenceLimits, FollowsASmoothPath) {
  ReferenceState state;
  for (int i = 1; i < 3000; ++i) {
    const float t = 0.001F * static_cast<float>(i);
    const float q = 0.5F * std::sin(2.0F * t);
    const ReferenceStep step = step_towards(state, q, std::cos(2.0F * t), kLimits.velocity, kLimits, kDt);
    state = step.next;
    if (i > 300) {
      EXPECT_NEAR(state.q, static_cast<double>(q), 1.1e-3) << "at " << t << " s";
      EXPECT_EQ(step.interventions, 0) << "at " << t << " s";
    }
  }
}

TEST(ReferenceLimits, NamesWhatItDid) {
  EXPECT_EQ(step_towards({}, 2.0F, 0.0F, 2.0F, kLimits, kDt).interventions & bit(Intervention::position_limit),
            bit(Intervention::position_limit));
  EXPECT_TRUE(step_towards({}, 0.5F, 0.0F, 2.0F, kLimits, kDt).interventions & bit(Intervention::acceleration_limit));
  EXPECT_TRUE(step_towards({0, 2.0}, 0.9F, 2.0F, 2.0F, kLimits, kDt).interventions & bit(Intervention::velocity_limit));
  EXPECT_TRUE(step_towards({0.9, 1.414}, 1.0F, 2.0F, 2.0F, kLimits, kDt).interventions &
              bit(Intervention::braking_distance));
  EXPECT_EQ(step_towards({}, 1e-6F, 0.0F, 2.0F, kLimits, kDt).interventions, 0);
}

TEST(ReferenceLimits, ALoweredSpeedIsApproachedByBraking) {
  ReferenceState state{0.0, 2.0};
  for (int i = 0; i < 50; ++i) {
    const ReferenceState next = step_towards(state, 1.0F, 0.0F, 0.1F, kLimits, kDt).next;
    EXPECT_GE(next.dq, state.dq - 0.01 - 1e-9);
    state = next;
  }
  EXPECT_NEAR(state.dq, 1.5, 0.07) << "the acceleration builds up first";
}

}  // namespace
}  // namespace takt::pipeline
