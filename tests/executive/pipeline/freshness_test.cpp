// SPDX-License-Identifier: Apache-2.0
// Goal: the verdict changes at its documented instants, the bound is exact, and flapping loses. Method: instants one
// nanosecond either side of each edge; a relapse schedule walked by hand.
#include "executive/pipeline/freshness.hpp"

#include <gtest/gtest.h>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

const FreshnessContract kContract = testing::robot(1).freshness;
constexpr MonoTime kSensed{1'000'000'000};
constexpr MonoTime kPublished{1'001'000'000};

Freshness at(MonoTime now, Duration step_period, std::uint16_t steps) {
  CommandInUse command;
  command.sequence = 1;
  command.sensed_at = kSensed;
  command.observed_at = kPublished;
  CommandHeader header;
  header.step_period = step_period;
  header.step_count = steps;
  return freshness_of(command, header, now, kContract);
}

TEST(Freshness, WithoutACommandIsMissing) {
  EXPECT_EQ(freshness_of({}, {}, kSensed, kContract), Freshness::missing);
}

TEST(Freshness, TurnsAtTheExactInstant) {
  const Duration period = milliseconds(10);
  EXPECT_EQ(at(kSensed + milliseconds(80), period, 16), Freshness::fresh);
  EXPECT_EQ(at(kSensed + milliseconds(80) + microseconds(1), period, 16), Freshness::aging);
  EXPECT_EQ(at(kSensed + milliseconds(100), period, 16), Freshness::aging);
  EXPECT_EQ(at(kSensed + milliseconds(100) + nanoseconds(1), period, 16), Freshness::stale);
}

TEST(Freshness, ASpentChunkIsMissingUntilItIsStale) {
  const Duration period = milliseconds(10);
  EXPECT_EQ(at(kPublished + milliseconds(20) - nanoseconds(1), period, 2), Freshness::fresh);
  EXPECT_EQ(at(kPublished + milliseconds(20), period, 2), Freshness::missing);
  EXPECT_EQ(at(kPublished + milliseconds(200), period, 2), Freshness::stale);
}

// Goal: a command dies with its age or with its chunk, whichever comes first, at the instant from which freshness_of
// no longer calls it usable. Method: a chunk that outlives max_age, and one that does not.
TEST(Freshness, ACommandIsValidUntilItsAgeOrItsChunkEnds) {
  CommandInUse command;
  command.sequence = 1;
  command.sensed_at = kSensed;
  command.observed_at = kPublished;
  CommandHeader header;
  header.step_period = milliseconds(10);
  header.step_count = 16;
  EXPECT_EQ(valid_until(command, header, kContract), kSensed + kContract.max_age);
  header.step_count = 3;
  EXPECT_EQ(valid_until(command, header, kContract), kPublished + milliseconds(30));
  EXPECT_TRUE(is_usable(freshness_of(command, header, kPublished + milliseconds(30) - nanoseconds(1), kContract)));
  EXPECT_FALSE(is_usable(freshness_of(command, header, kPublished + milliseconds(30), kContract)));
}

TEST(Freshness, ViolationNeedsMoreThanTheBound) {
  const MonoTime now{1'000'000'000};
  EXPECT_FALSE(is_violated(10, {}, now, kContract)) << "epsilon * window = 10 is still allowed";
  EXPECT_TRUE(is_violated(11, {}, now, kContract));
}

// Goal: a silent policy is noticed after degrade_after, whatever the window's share allows, and not a moment before.
// Method: one usable tick, then the instants around degrade_after, without a single miss counted.
TEST(Freshness, SilenceAloneViolatesAfterDegradeAfter) {
  FreshnessContract contract = kContract;
  contract.degrade_after = milliseconds(40);
  const MonoTime heard{1'000'000'000};
  Recovery recovery;
  note_freshness(recovery, Freshness::fresh, heard);
  EXPECT_FALSE(is_violated(0, recovery, heard + milliseconds(40) - nanoseconds(1), contract));
  EXPECT_TRUE(is_violated(0, recovery, heard + milliseconds(40), contract));
}

TEST(Recovery, FlappingDoublesTheWaitUpToSixteenTimes) {
  Recovery recovery;
  MonoTime now{1'000'000'000};
  const auto wait_needed = [&] {
    const MonoTime since = now;
    note_freshness(recovery, Freshness::fresh, now);
    while (!is_restored(recovery, now, kContract)) {
      now = now + milliseconds(1);
      note_freshness(recovery, Freshness::aging, now);
    }
    return now - since;
  };
  for (const std::int64_t factor : {1, 2, 4, 8, 16, 16, 16}) {
    note_degraded(recovery, now, kContract);
    EXPECT_EQ(wait_needed(), kContract.recover_after * factor);
    note_restored(recovery, now);
    now = now + milliseconds(500);
  }
  now = now + kContract.flap_memory;
  note_degraded(recovery, now, kContract);
  EXPECT_EQ(wait_needed(), kContract.recover_after) << "forgiven after flap_memory";
}

TEST(Recovery, OneMissStartsTheWaitAgain) {
  Recovery recovery;
  const MonoTime start{1'000'000'000};
  note_degraded(recovery, start, kContract);
  note_freshness(recovery, Freshness::fresh, start);
  note_freshness(recovery, Freshness::stale, start + milliseconds(199));
  note_freshness(recovery, Freshness::fresh, start + milliseconds(200));
  EXPECT_FALSE(is_restored(recovery, start + milliseconds(201), kContract));
  EXPECT_TRUE(is_restored(recovery, start + milliseconds(400), kContract));
}

TEST(Recovery, ACommandIsLostExactlyAfterStopAfter) {
  Recovery recovery;
  const MonoTime start{1'000'000'000};
  note_freshness(recovery, Freshness::fresh, start);
  note_freshness(recovery, Freshness::missing, start + milliseconds(1));
  EXPECT_FALSE(is_command_lost(recovery.last_usable_at, start + milliseconds(500) - nanoseconds(1), kContract));
  EXPECT_TRUE(is_command_lost(recovery.last_usable_at, start + milliseconds(500), kContract));
}

}  // namespace
}  // namespace takt::pipeline
