// SPDX-License-Identifier: Apache-2.0
// Goal: the verdict changes at its documented instants, the bound is exact, and flapping loses. Method: instants one
// nanosecond either side of each edge; a relapse schedule walked by hand.
#include "executive/pipeline/freshness.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <random>
#include <vector>

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

// Silences of one length, at random instants that miss this share of a long run's ticks. How many of the runs are
// declared violated, of `runs`; and after how many ticks in the median, of those that are.
struct Declared {
  int runs = 0;
  std::uint64_t median_ticks = 0;
};
Declared declared(double share, std::uint32_t silence, std::uint64_t ticks, int runs, FreshnessContract contract) {
  std::vector<std::uint64_t> after;
  for (int run = 0; run < runs; ++run) {
    std::mt19937_64 random(std::uint64_t{1000} * silence + static_cast<std::uint64_t>(run));
    // From the end of one to the begin of the next.
    std::geometric_distribution<std::uint64_t> gap(share / (static_cast<double>(silence) * (1 - share)));
    Recovery recovery;
    std::uint64_t tick = 0;
    while (tick < ticks && !is_violated(recovery, contract)) {
      for (std::uint64_t met = gap(random) + 1; met > 0 && tick < ticks; --met, ++tick)
        note_miss(recovery, false, contract);
      for (std::uint32_t i = 0; i < silence && tick < ticks && !is_violated(recovery, contract); ++i, ++tick)
        note_miss(recovery, true, contract);
    }
    if (is_violated(recovery, contract)) after.push_back(tick);
  }
  std::ranges::sort(after);
  return {static_cast<int>(after.size()), after.empty() ? 0 : after[after.size() / 2]};
}

constexpr std::uint64_t kHour = 3'600'000;

// Goal: a process that keeps the contract is not said to break it, whatever the length of its silences, and one that
// breaks it is. Method: hours at a tenth and at half of epsilon, silences of 1 to 300 ms; and at twice epsilon.
TEST(Violation, IsDeclaredOnEvidenceAlone) {
  for (const std::uint32_t silence : {1U, 5U, 20U, 50U, 300U}) {
    const double epsilon = kContract.epsilon;
    const Declared tenth = declared(epsilon / 10, silence, kHour, 20, kContract);
    EXPECT_EQ(tenth.runs, 0) << silence << " ms, a tenth";
    const Declared half = declared(epsilon / 2, silence, kHour, 40, kContract);
    EXPECT_LE(half.runs, 2) << silence << " ms, half: 95 % of the hours";
    const Declared twice = declared(2 * epsilon, silence, kHour, 20, kContract);
    EXPECT_EQ(twice.runs, 20) << silence << " ms, twice";
    EXPECT_LE(twice.median_ticks, static_cast<std::uint64_t>(2 * kEvidence / epsilon) * silence) << silence << " ms";
    std::printf(
        "silences of %3u ms: declared in an hour: %d of 20 at a tenth, %d of 40 at half, %d of 20 at twice "
        "epsilon, there after %.1f s (median)\n",
        silence, tenth.runs, half.runs, twice.runs, static_cast<double>(twice.median_ticks) / 1000);
  }
}

TEST(Violation, ABurstOfTheWindowsShareIsAllowed) {
  Recovery recovery;
  for (int i = 0; i < 10; ++i) {
    note_miss(recovery, true, kContract);
    note_miss(recovery, false, kContract);
  }
  EXPECT_FALSE(is_violated(recovery, kContract)) << "epsilon * window = 10 is still allowed";
  for (int i = 0; i < 3; ++i) {
    note_miss(recovery, true, kContract);
    note_miss(recovery, false, kContract);
  }
  EXPECT_TRUE(is_violated(recovery, kContract));
  forget_misses(recovery);
  EXPECT_FALSE(is_violated(recovery, kContract));
}

// One silence, however long, is one: command_late and command_lost answer for it.
TEST(Violation, OneSilenceIsNoEvidence) {
  Recovery recovery;
  for (int i = 0; i < 5000; ++i) note_miss(recovery, true, kContract);
  EXPECT_FALSE(is_violated(recovery, kContract));
}

// Goal: a silent policy is noticed after degrade_after and not a moment before. Method: one usable tick, then the
// instants around degrade_after, without a single miss counted.
TEST(Freshness, SilenceIsLateAfterDegradeAfter) {
  FreshnessContract contract = kContract;
  contract.degrade_after = milliseconds(40);
  const MonoTime heard{1'000'000'000};
  Recovery recovery;
  note_freshness(recovery, Freshness::fresh, heard);
  EXPECT_FALSE(is_late(recovery, heard + milliseconds(40) - nanoseconds(1), contract));
  EXPECT_TRUE(is_late(recovery, heard + milliseconds(40), contract));
}

TEST(Freshness, SilenceIsLateAfterEpsilonOfTheWindow) {
  const MonoTime now{1'000'000'000};
  Recovery recovery;
  for (int i = 0; i < 10; ++i) note_miss(recovery, true, kContract);
  EXPECT_FALSE(is_late(recovery, now, kContract)) << "epsilon * window = 10 is still allowed";
  note_miss(recovery, true, kContract);
  EXPECT_TRUE(is_late(recovery, now, kContract));
  note_miss(recovery, false, kContract);
  EXPECT_FALSE(is_late(recovery, now, kContract)) << "it is over";
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
