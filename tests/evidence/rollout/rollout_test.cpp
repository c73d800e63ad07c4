// SPDX-License-Identifier: Apache-2.0
// Goal: a rollout is a function of its setup: equal bytes from equal seeds, other bytes from another seed, and the
// demo arm succeeds when nothing troubles it. Method: rollouts of the demo arm in virtual time, judged by their rows.
#include <gtest/gtest.h>

#include "tests/evidence/rollout/arm_rollouts.hpp"

namespace takt::lab {
namespace {

TEST(Rollout, RepeatsItselfBitForBit) {
  const evidence::RolloutRow first = test::run("can_loss");
  const evidence::RolloutRow again = test::run("can_loss");
  EXPECT_EQ(first.replay_hash, again.replay_hash);
  EXPECT_EQ(first.energy_J, again.energy_J);
}

TEST(Rollout, AnotherSeedIsAnotherRollout) {
  EXPECT_NE(test::run("none", 1).replay_hash, test::run("none", 2).replay_hash);
}

TEST(Rollout, NominalSucceeds) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const evidence::RolloutRow row = test::run("none", seed);
    EXPECT_TRUE(row.success) << row.failure_label;
    EXPECT_EQ(row.final_mode, Mode::tracking);
    EXPECT_EQ(row.misses_per_tick.misses, 0U);
    EXPECT_EQ(row.constraint_violations, 0U);
    EXPECT_FALSE(row.recovery_s.has_value());
  }
}

}  // namespace
}  // namespace takt::lab
