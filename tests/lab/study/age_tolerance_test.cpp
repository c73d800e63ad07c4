// SPDX-License-Identifier: Apache-2.0
// Goal: the age that the task tolerates is found, the proposal follows its rule, and neither depends on the number of
// workers. Method: the demo arm's rollouts, short and few, with a success rate that few can show.
#include "lab/study/age_tolerance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace takt::study {
namespace {

ToleranceSetup small(std::size_t workers) {
  return {.robot_file = "config/arm6.yaml",
          .seeds = 6,
          .success = 0.5,
          .workers = workers,
          .duration = seconds(4),
          .scored = seconds(1)};
}

TEST(AgeTolerance, ProposalFollowsWhatTheTaskTolerates) {
  const auto found = age_tolerance(small(2));
  ASSERT_TRUE(found) << found.error();
  ASSERT_GE(found->ages.size(), 3U);
  EXPECT_EQ(found->ages.front().dose_ms, 0);
  EXPECT_TRUE(found->ages.front().tolerated);
  const TolerancePoint* tolerated = nullptr;
  bool refused = false;
  for (const TolerancePoint& point : found->ages) {
    if (point.tolerated) {
      EXPECT_NEAR(point.age_p50_ms, found->ages.front().age_p50_ms + point.dose_ms, 12);
    }
    if (point.tolerated && !refused) tolerated = &point;
    refused |= !point.tolerated;
  }
  EXPECT_TRUE(refused) << "no arm tracks a moving target with commands of any age";
  EXPECT_EQ(found->tolerated_age_ms, tolerated->age_p50_ms);
  EXPECT_EQ(found->max_age_ms, 5 * std::floor(0.8 * found->tolerated_age_ms / 5));
  ASSERT_FALSE(found->misses.empty());
  if (found->tolerated_share) {
    EXPECT_LE(*found->epsilon, 0.8 * *found->tolerated_share);
    EXPECT_GT(*found->epsilon, 0.7 * *found->tolerated_share);
  }
  ASSERT_FALSE(found->silences.empty());
  if (found->stop_after_ms) {
    EXPECT_EQ(*found->stop_after_ms, 5 * std::floor(0.8 * *found->tolerated_silence_ms / 5));
    EXPECT_GT(*found->stop_after_ms, found->max_age_ms);
  }
}

// Goal: how to come back from degraded mode is chosen by what it costs. Method: the demo arm; of the tried ways the one
// proposed succeeds as often as any, and none of those has clearly fewer ticks in violation.
TEST(AgeTolerance, TheWayBackIsTheOneThatCostsLeast) {
  const auto found = age_tolerance(small(2));
  ASSERT_TRUE(found) << found.error();
  ASSERT_EQ(found->recoveries.size(), 6U);
  ASSERT_TRUE(found->recovery);
  const RecoveryPoint& best = *found->recovery;
  bool differ = false;
  for (const RecoveryPoint& point : found->recoveries) {
    EXPECT_EQ(point.rollouts, 12U) << "six seeds of two troubles";
    EXPECT_LE(point.successes, best.successes);
    if (point.successes == best.successes) {
      EXPECT_LE(best.violated_ticks, 1.1 * point.violated_ticks + 1);
    }
    differ |= point.violated_ticks > best.violated_ticks + 1;
  }
  EXPECT_TRUE(differ) << "a choice that costs nothing either way shows nothing";
  EXPECT_LT(best.recover_after, milliseconds(250)) << "waiting long costs ticks in violation";
}

// Goal: a robot without an inner loop to measure has its age tolerance. Method: the demo cart, whose pole falls when
// commands are too old.
TEST(AgeTolerance, OfACartThatBalancesAPole) {
  ToleranceSetup setup = small(2);
  setup.robot_file = "config/cart_pole.yaml";
  setup.task = evidence::Task::cart_pole_balance;
  setup.bound_m = 0.4;
  setup.duration = seconds(6);
  const auto found = age_tolerance(setup);
  ASSERT_TRUE(found) << found.error();
  EXPECT_FALSE(found->age_is_open);
  EXPECT_GT(found->tolerated_age_ms, found->ages.front().age_p50_ms);
  EXPECT_GT(found->max_age_ms, 0);
}

// Goal: progress counts each rollout, and the most that there can be is an upper bound that only falls, to what was
// run. Method: the smallest search.
TEST(AgeTolerance, ProgressSaysHowMuchIsLeftAtMost) {
  std::vector<ToleranceProgress> all;
  ToleranceSetup setup = small(2);
  setup.on_progress = [&](const ToleranceProgress& one) { all.push_back(one); };
  const auto found = age_tolerance(setup);
  ASSERT_TRUE(found) << found.error();
  std::size_t rollouts = 0;
  for (const auto* points : {&found->ages, &found->misses, &found->silences})
    for (const TolerancePoint& point : *points) rollouts += point.rollouts;
  for (const RecoveryPoint& point : found->recoveries) rollouts += point.rollouts;
  ASSERT_EQ(all.size(), rollouts);
  EXPECT_EQ(all.front().dose, "publish_delay 0 ms");
  EXPECT_TRUE(all.back().dose.starts_with("recover_after ")) << all.back().dose;
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].rollouts, i + 1);
    EXPECT_GE(all[i].at_most, rollouts);
    if (i > 0) {
      EXPECT_LE(all[i].at_most, all[i - 1].at_most);
    }
  }
}

TEST(AgeTolerance, DoesNotDependOnWorkers) {
  const auto one = age_tolerance(small(1)), two = age_tolerance(small(2));
  ASSERT_TRUE(one && two);
  EXPECT_EQ(one->tolerated_age_ms, two->tolerated_age_ms);
  EXPECT_EQ(one->tolerated_share, two->tolerated_share);
  ASSERT_EQ(one->ages.size(), two->ages.size());
  for (std::size_t i = 0; i < one->ages.size(); ++i) {
    EXPECT_EQ(one->ages[i].rollouts, two->ages[i].rollouts);
    EXPECT_EQ(one->ages[i].age_p99_ms, two->ages[i].age_p99_ms);
  }
}

TEST(AgeTolerance, ATaskThatFailsWithoutDelayToleratesNothing) {
  ToleranceSetup setup = small(1);
  setup.bound_m = 1e-6;
  const auto found = age_tolerance(setup);
  ASSERT_FALSE(found);
  EXPECT_EQ(
      found.error(),
      "config/arm6.yaml: the task fails without any added delay, in 6 of 6 rollouts; there is no age to tolerate");
}

TEST(AgeTolerance, FewerSeedsThanTheLeastCannotShowIt) {
  EXPECT_GE(std::pow(0.05, 1.0 / kLeastSeeds), 0.95);
  EXPECT_LT(std::pow(0.05, 1.0 / (kLeastSeeds - 1)), 0.95);
}

}  // namespace
}  // namespace takt::study
