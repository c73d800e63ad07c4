// SPDX-License-Identifier: Apache-2.0
// Goal: after the computer slept nothing older is believed: CLOCK_MONOTONIC stood still, so that what was sensed,
// published or asked for before looks hours too young. Method: virtual time that does not move, an input that says how
// long the sleep was.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;
using testing::robot;

// The first tick after a sleep. Its feedback is what was read before it.
void wake_up(Rig& rig) {
  for (auto& drive : rig.drives) drive.silent = true;
  rig.input.slept_ms = 5'000;
  rig.tick();
  rig.input.slept_ms = 0;
}

bool is_lost(const Rig& rig) {
  return (rig.header().causes_active & bit(Cause::feedback_lost)) != 0;
}

TEST(Suspend, ATrackingRobotIsLatchedAndNothingOlderIsPlayed) {
  Rig rig(robot(3));
  rig.arm(0.5F);
  rig.run_with_policy(500, 0.5F);
  ASSERT_EQ(rig.mode(), Mode::tracking);
  wake_up(rig);
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
  EXPECT_EQ(rig.header().cause, Cause::feedback_lost);
  EXPECT_EQ(rig.header().slept_ms, 5'000U);
  EXPECT_EQ(rig.header().seats[Seat::policy].freshness, Freshness::missing);
  EXPECT_FALSE(rig.out->valid_until.is_set());
}

TEST(Suspend, AnswersToWhatWasPublishedBeforeAreRefused) {
  Rig rig(robot(2));
  rig.run_with_policy(100, 0.1F);
  const std::uint64_t before = rig.newest_observation;
  wake_up(rig);
  const auto chunk = std::make_unique<CommandChunk>(
      chunk_for(rig.config, before, rig.published_at[before], rig.now, ++rig.sequence, 0.1F));
  rig.tick(chunk.get());
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::expired_observation);
  EXPECT_EQ(rig.header().seats[Seat::policy].freshness, Freshness::missing);
}

TEST(Suspend, FeedbackIsLostUntilEachJointRepliesAgain) {
  Rig rig(robot(2));
  rig.run_with_policy(100, 0.1F);
  ASSERT_FALSE(is_lost(rig));
  wake_up(rig);
  EXPECT_TRUE(is_lost(rig)) << "what is at hand was read before the sleep";
  rig.tick();
  EXPECT_TRUE(is_lost(rig)) << "and does not come back";
  rig.drives[0].silent = false;
  rig.tick();
  EXPECT_TRUE(is_lost(rig)) << "joint 1 did not reply yet";
  rig.drives[1].silent = false;
  rig.tick();
  EXPECT_FALSE(is_lost(rig));
  EXPECT_EQ(rig.mode(), Mode::standby);
}

// A drive that follows positions with gains of its own is told none that it did not have since the sleep: neither the
// one of before, nor the estimate of a joint that was not heard yet, which is 0.
TEST(Suspend, ALatePositionDriveIsToldWhereItsJointIs) {
  for (const int silent_ticks : {1, 2, 10}) {
    TickConfig config = robot(2);
    config.joints[1].loop = LoopAt::drive_position;
    config.joints[1].limits.torque = 400;  // nothing cuts its stiffness
    Rig rig(config);
    rig.arm(1.2F);
    rig.run_with_policy(1'500, 1.2F);
    ASSERT_EQ(rig.mode(), Mode::tracking);
    ASSERT_NEAR(rig.drives[1].q, 1.2F, 0.05F);
    rig.drives[1].q -= 0.3F;  // it sank meanwhile
    rig.drives[1].dq = 0;
    wake_up(rig);
    const auto expect_no_throw = [&](const char* when, int tick) {
      const JointSetpoint& damping = rig.out->damping[1];
      if (!rig.out->drive_enabled[1] || damping.kp == 0) return;
      EXPECT_NEAR(damping.q, rig.drives[1].q, 0.02F) << when << ' ' << tick << " of " << silent_ticks;
    };
    expect_no_throw("waking", 0);
    for (int i = 0; i < silent_ticks; ++i) {
      rig.tick();
      expect_no_throw("silent tick", i);
    }
    for (auto& drive : rig.drives) drive.silent = false;
    for (int i = 0; i < 5; ++i) {
      rig.tick();
      expect_no_throw("heard again, tick", i);
      ASSERT_TRUE(rig.out->drive_enabled[1]);
    }
  }
}

TEST(Suspend, TheRobotArmsAgainOnceEverythingIsNew) {
  Rig rig(robot(2));
  rig.arm(0.1F);
  rig.run_with_policy(500, 0.1F);
  wake_up(rig);
  for (auto& drive : rig.drives) drive.silent = false;
  rig.run_with_policy(200, 0.1F);
  rig.tick_with_policy(0.1F, OperatorRequest::reset);
  ASSERT_EQ(rig.mode(), Mode::standby);
  rig.arm(0.1F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

}  // namespace
}  // namespace takt::pipeline
