// SPDX-License-Identifier: Apache-2.0
// Goal: simulated time keeps up with wall time, short stalls are caught up with, long ones are skipped and counted, and
// the wake-ups settle behind the commands. Method: wall time is a number here.
#include "simulation/pacer.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace takt::simulation {
namespace {

constexpr MonoTime kFirst{10'000'000};
constexpr Duration kStep = milliseconds(1);

TEST(Pacer, OneStepPerPeriodNoneWhenEarly) {
  Pacer pacer(kStep, kFirst);
  EXPECT_EQ(pacer.steps_due(kFirst - nanoseconds(1)), 0);
  EXPECT_EQ(pacer.steps_due(kFirst), 1);
  EXPECT_EQ(pacer.steps_due(kFirst), 0);
  EXPECT_EQ(pacer.next_wake(), kFirst + kStep);
  EXPECT_EQ(pacer.steps_due(kFirst + kStep + microseconds(900)), 1) << "late, but within the period";
  EXPECT_EQ(pacer.next_wake(), kFirst + kStep * 2) << "phase kept";
}

TEST(Pacer, CatchesUpWithAShortStall) {
  Pacer pacer(kStep, kFirst);
  EXPECT_EQ(pacer.steps_due(kFirst + milliseconds(30)), 31);
  EXPECT_EQ(pacer.skipped(), 0U);
  EXPECT_EQ(pacer.next_wake(), kFirst + milliseconds(31));
}

TEST(Pacer, SkipsTheRestOfALongStall) {
  Pacer pacer(kStep, kFirst);
  EXPECT_EQ(pacer.steps_due(kFirst + seconds(10)), Pacer::kMaxCatchUp);
  EXPECT_EQ(pacer.skipped(), 10'001U - Pacer::kMaxCatchUp);
  EXPECT_EQ(pacer.next_wake(), kFirst + seconds(10) + kStep);
}

TEST(Pacer, SettlesBehindTheCommandsFromAnyPhase) {
  for (std::int64_t phase_us = 0; phase_us < 1000; phase_us += 50) {
    Pacer pacer(kStep, kFirst + microseconds(phase_us));
    for (int turn = 0; turn < 500; ++turn) {
      const MonoTime now = pacer.next_wake();
      ASSERT_EQ(pacer.steps_due(now), 1);
      // The newest command: the last one sent before now, one each millisecond on the millisecond.
      pacer.follow(MonoTime{now.ns / 1'000'000 * 1'000'000});
      ASSERT_LE(std::abs((pacer.next_wake() - now - kStep).ns), Pacer::kMaxNudge.ns);
    }
    EXPECT_NEAR(static_cast<double>(pacer.next_wake().ns % 1'000'000), static_cast<double>(Pacer::kLead.ns), 20e3)
        << "started at " << phase_us << " us";
  }
}

}  // namespace
}  // namespace takt::simulation
