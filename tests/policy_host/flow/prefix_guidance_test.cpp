// SPDX-License-Identifier: Apache-2.0
// Goal: the weights of guided real-time chunking are the published ones. Method: the published example, and the ends of
// every schedule.
#include "policy_host/flow/prefix_guidance.hpp"

#include <gtest/gtest.h>

namespace takt::policy_host {
namespace {

TEST(PrefixGuidance, LinearWeightsAreThePublishedOnes) {
  constexpr double kWeights[] = {1, 1, 0.8, 0.6, 0.4, 0.2, 0, 0, 0, 0};  // 10 steps, delay 2, end 6
  for (std::size_t step = 0; step < 10; ++step)
    EXPECT_NEAR(prefix_weight(PrefixSchedule::linear, step, 2, 6), kWeights[step], 1e-12) << "step " << step;
}

TEST(PrefixGuidance, EverySchedulePinsWhatIsPromisedAndFreesTheEnd) {
  for (const PrefixSchedule schedule :
       {PrefixSchedule::ones, PrefixSchedule::zeros, PrefixSchedule::linear, PrefixSchedule::exponential}) {
    for (std::size_t step = 0; step < 3; ++step) EXPECT_NEAR(prefix_weight(schedule, step, 3, 8), 1.0, 1e-12);
    for (std::size_t step = 8; step < 12; ++step) EXPECT_EQ(prefix_weight(schedule, step, 3, 8), 0.0);
    EXPECT_EQ(prefix_weight(schedule, 4, 9, 4), 0.0) << "a delay beyond the end promises no more than there is";
  }
  EXPECT_EQ(prefix_weight(PrefixSchedule::zeros, 3, 3, 8), 0.0);
  EXPECT_EQ(prefix_weight(PrefixSchedule::ones, 7, 3, 8), 1.0);
  EXPECT_NEAR(prefix_weight(PrefixSchedule::exponential, 2, 2, 6), 0.8 * std::expm1(0.8) / std::expm1(1.0), 1e-12);
}

TEST(PrefixGuidance, TheErrorsShareIsBounded) {
  EXPECT_EQ(guidance_scale(0.0, 5.0), 5.0);
  EXPECT_EQ(guidance_scale(0.01, 5.0), 5.0);
  EXPECT_NEAR(guidance_scale(0.5, 5.0), 2.0, 1e-12);
  EXPECT_EQ(guidance_scale(1.0, 5.0), 5.0) << "not a number";
}

}  // namespace
}  // namespace takt::policy_host
