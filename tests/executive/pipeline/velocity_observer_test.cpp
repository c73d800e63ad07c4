// SPDX-License-Identifier: Apache-2.0
// Goal: the observer follows a moving joint through missing, repeated, late and absurd replies. Method: replies along a
// known path, checked against that path.
#include "executive/pipeline/velocity_observer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace takt::pipeline {
namespace {

constexpr float kBandwidth = 200.0F;

JointFeedback reply(MonoTime at, float q) {
  JointFeedback feedback;
  feedback.received_at = at;
  feedback.q = q;
  return feedback;
}

TEST(VelocityObserver, StartsAtTheFirstReplyAtRest) {
  ObserverState observer;
  EXPECT_EQ(estimate_at(observer, {5}, seconds(1)).q, 0.0F);
  take_reply(observer, reply({1'000'000}, 0.7F), kBandwidth);
  EXPECT_EQ(estimate_at(observer, {1'000'000}, seconds(1)).q, 0.7F);
  EXPECT_EQ(estimate_at(observer, {9'000'000}, seconds(1)).dq, 0.0F);
}

TEST(VelocityObserver, FollowsARampWithUnevenSpacing) {
  ObserverState observer;
  std::int64_t t = 1'000'000'000;
  for (int i = 0; i < 400; ++i) {
    t += i % 3 == 0 ? 700'000 : 1'300'000;
    if (i % 7 == 0) continue;  // a lost reply: the next one comes later
    take_reply(observer, reply({t}, 0.5F * static_cast<float>(t - 1'000'000'000) * 1e-9F), kBandwidth);
  }
  EXPECT_NEAR(observer.dq, 0.5F, 1e-3F);
  const JointMotion ahead = estimate_at(observer, {t + 4'000'000}, milliseconds(20));
  EXPECT_NEAR(ahead.q, 0.5F * (static_cast<float>(t - 1'000'000'000) * 1e-9F + 0.004F), 1e-4F);
}

TEST(VelocityObserver, PredictsNoLongerThanAllowed) {
  ObserverState observer{{1'000'000'000}, 1.0F, 2.0F};
  EXPECT_NEAR(estimate_at(observer, {2'000'000'000}, milliseconds(20)).q, 1.04F, 1e-6F);
  EXPECT_EQ(estimate_at(observer, {500'000'000}, milliseconds(20)).q, 1.0F) << "never predicts backwards";
}

TEST(VelocityObserver, IgnoresWhatIsNoNewReply) {
  const ObserverState before{{1'000'000'000}, 1.0F, 2.0F};
  for (const JointFeedback& feedback :
       {reply({1'000'000'000}, 3.0F), reply({999'999'999}, 3.0F), reply({}, 3.0F), reply({2'000'000'000}, NAN),
        reply({2'000'000'000}, std::numeric_limits<float>::infinity()), reply({2'000'000'000}, 1e30F)}) {
    ObserverState observer = before;
    take_reply(observer, feedback, kBandwidth);
    EXPECT_EQ(observer.q, before.q);
    EXPECT_EQ(observer.dq, before.dq);
    EXPECT_EQ(observer.sampled_at, before.sampled_at);
  }
}

TEST(VelocityObserver, QuietensEncoderSteps) {
  ObserverState observer;
  float worst = 0.0F;
  for (int i = 1; i < 500; ++i) {
    const float quantised = i % 2 == 0 ? 0.0F : 0.0004F;
    take_reply(observer, reply({i * 1'000'000LL}, quantised), kBandwidth);
    if (i > 100) worst = std::max(worst, std::abs(observer.dq));
  }
  EXPECT_LT(worst, 0.4F * 0.0004F / 0.001F) << "a difference quotient would say 0.4 rad/s";
  EXPECT_GT(worst, 0.0F);
}

}  // namespace
}  // namespace takt::pipeline
