// SPDX-License-Identifier: Apache-2.0
// Goal: a drive that is written to every n-th tick owes a reply per turn and no more, is followed and stopped like any
// other, and is written to at once when the mode changes. Method: the rig's robot, whose drives answer what they are
// sent and go on with what they were told last.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;

TickConfig divided_robot(std::uint8_t every) {
  TickConfig config = testing::robot(3);
  for (std::size_t j = 0; j < 3; ++j) config.joints[j].turns = {every, static_cast<std::uint8_t>(j % every)};
  config.joints[2].turns = {};
  return config;
}

constexpr CauseMask kReplies =
    bit(Cause::replies_lost) | bit(Cause::replies_repeated) | bit(Cause::replies_delayed) | bit(Cause::feedback_lost);

TEST(Turns, AReplyPerTurnIsNoFault) {
  for (const std::uint8_t every : std::array<std::uint8_t, 4>{2, 3, 5, 8}) {
    Rig rig(divided_robot(every));
    rig.arm(0.5F);
    ASSERT_EQ(rig.mode(), Mode::tracking) << int{every};
    for (int i = 0; i < 4000; ++i) {
      rig.tick_with_policy(0.5F);
      ASSERT_EQ(rig.header().causes_active & kReplies, 0U) << int{every} << " at " << i;
    }
    EXPECT_NEAR(rig.drives[0].q, 0.5F, 0.02F) << "and it goes where it is told";
    EXPECT_NEAR(rig.drives[2].q, 0.5F, 0.02F);
  }
}

// Each change of mode has a frame out of turn, and its answer is no repetition.
TEST(Turns, ChangesOfModeAreNoRepetition) {
  TickConfig config = divided_robot(4);
  config.freshness.recover_after = milliseconds(5);
  config.freshness.flap_memory = {};
  Rig rig(config);
  rig.arm(0.2F);
  int changes = 0;
  for (int i = 0; i < 40; ++i) {
    rig.run(115);
    rig.run_with_policy(60, 0.2F);
    changes += rig.mode() == Mode::tracking ? 1 : 0;
    ASSERT_EQ(rig.header().causes_active & kReplies, 0U) << i;
  }
  EXPECT_GT(changes, 20) << "it was degraded and came back";
}

TEST(Turns, ASilentDriveIsLostInItsTimeAndRepeatsAreFound) {
  Rig rig(divided_robot(2));
  rig.arm(0.2F);
  rig.drives[0].silent = true;
  int ticks = 0;
  for (; rig.mode() == Mode::tracking && ticks < 100; ++ticks) rig.tick_with_policy(0.2F);
  EXPECT_EQ(rig.header().cause, Cause::feedback_lost);
  EXPECT_LE(ticks, 22) << "feedback_timeout is 20 ms";

  Rig twice(divided_robot(2));
  twice.arm(0.2F);
  for (int i = 0; i < 1000 && twice.mode() == Mode::tracking; ++i) {
    twice.tick_with_policy(0.2F);
    ++twice.input.joints[0].replies;
  }
  EXPECT_EQ(twice.header().cause, Cause::replies_repeated);
}

TEST(Turns, HalfOfItsRepliesLostIsAFaultByTheShareOfItsTurns) {
  Rig rig(divided_robot(2));
  rig.arm(0.2F);
  std::uint8_t shown = rig.input.joints[0].replies;
  for (int i = 0; i < 6000 && rig.mode() == Mode::tracking; ++i) {
    const std::uint8_t before = rig.input.joints[0].replies;
    rig.tick_with_policy(0.2F);
    // Every reply but one of three vanishes: its count does not go on.
    if (rig.input.joints[0].replies != before) rig.input.joints[0].replies = i % 3 == 0 ? ++shown : shown;
  }
  EXPECT_EQ(rig.header().cause, Cause::replies_lost);
}

// Goal: the window in which a drive's faults are counted is as long in time, however rarely it is written to. Method:
// a drive that answers each frame twice; the ticks until that is a fault, by its turns. Shares of a window of fewer
// turns are rounder.
TEST(Turns, AFaultsWindowIsAsLongForEverybody) {
  const auto ticks_until_fault = [](std::uint8_t every) {
    TickConfig config = divided_robot(every);
    config.bus_faults.window_ticks = 800;
    config.bus_faults.replies_repeated = share_of_ticks(0.5);
    Rig rig(config);
    rig.arm(0.2F);
    int ticks = 0;
    for (; ticks < 8000 && (rig.header().causes_active & bit(Cause::replies_repeated)) == 0; ++ticks) {
      std::uint8_t& replies = rig.input.joints[0].replies;
      const std::uint8_t before = replies;
      rig.tick_with_policy(0.2F);
      replies = static_cast<std::uint8_t>(replies + (replies - before));
    }
    return ticks;
  };
  const int undivided = ticks_until_fault(1);
  EXPECT_GT(undivided, 200);
  for (const std::uint8_t every : std::array<std::uint8_t, 3>{2, 4, 8})
    EXPECT_NEAR(ticks_until_fault(every), 1.35 * undivided, 0.35 * undivided) << int{every};
}

// The frame of a stop is told apart from its turn.
TEST(Turns, AStopIsWrittenAtOnce) {
  for (int phase = 0; phase < 5; ++phase) {
    Rig rig(divided_robot(5));
    rig.arm(0.5F);
    for (int i = 0; i < phase; ++i) rig.tick_with_policy(0.5F);
    rig.tick_with_policy(0.5F, OperatorRequest::stop);
    ASSERT_EQ(rig.mode(), Mode::damped_stop);
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_TRUE(is_written(rig.config.joints[j].turns, rig.header()));
      EXPECT_EQ(rig.drives[j].told.kp, 0.0F) << "told to damp in the very tick";
    }
  }
}

TEST(Turns, TheTorqueOfAFrameKeepsTheSlewOfItsTurn) {
  Rig rig(divided_robot(4));
  rig.arm(0.0F);
  float before = rig.out->record.joints[0].tau_total;
  for (int i = 0; i < 2000; ++i) {
    rig.tick_with_policy(i % 400 < 200 ? 1.0F : -1.0F);
    if (!is_written(rig.config.joints[0].turns, rig.header())) continue;
    const float now = rig.out->record.joints[0].tau_total;
    ASSERT_LE(std::abs(now - before), rig.config.joints[0].limits.torque_rate * 4e-3F + 0.05F) << i;
    before = now;
  }
}

}  // namespace
}  // namespace takt::pipeline
