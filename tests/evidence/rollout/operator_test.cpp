// SPDX-License-Identifier: Apache-2.0
// Goal: a panel's operator ends every stop the same way: no sooner than the panel says, never while something else
// still blocks arming, and the row tells. Method: the demo arm in virtual time with a dead policy, requests read from
// its tick records.
#include "evidence/rollout/operator.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "executive/pipeline/freshness.hpp"
#include "tests/evidence/rollout/arm_rollouts.hpp"

namespace takt::lab {
namespace {

struct Story {
  evidence::RolloutRow row;
  std::vector<TickRecordHeader> requests;  // ticks with one
  std::vector<Freshness> before;           // of the tick before each
  std::optional<MonoTime> stopped_at;      // the first stop
};

Story story_of(std::optional<Duration> rearm_after, std::string_view perturbation, double dose_factor = 1) {
  evidence::RolloutSetup wanted = test::setup(perturbation);
  wanted.duration = seconds(8);
  wanted.scored = seconds(2);
  wanted.perturbation.dose *= dose_factor;
  wanted.rearm_after = rearm_after;
  Story story;
  Freshness before = Freshness::missing;
  wanted.on_tick = [&](const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    if (header.operator_request != OperatorRequest::none) {
      story.requests.push_back(header);
      story.before.push_back(before);
    }
    before = header.seats[Seat::policy].freshness;
    const bool stops = header.mode != header.previous_mode && header.mode >= Mode::damped_stop;
    if (stops && !story.stopped_at) story.stopped_at = header.now;
  };
  story.row = test::run(wanted);
  return story;
}

TEST(Operator, NobodyEndsAStopUnlessThePanelSaysSo) {
  const Story story = story_of({}, "policy_crash");
  EXPECT_EQ(story.requests.size(), 1U) << "the first arming";
  EXPECT_EQ(story.row.rearms, 0U);
  EXPECT_FALSE(story.row.success);
  EXPECT_EQ(story.row.failure_label, "command_lost");
}

TEST(Operator, EndsAStopOnceNothingElseBlocksAndTheRolloutMaySucceed) {
  const Story story = story_of(milliseconds(500), "policy_crash");
  ASSERT_TRUE(story.stopped_at);
  ASSERT_GE(story.requests.size(), 3U);
  const TickRecordHeader& reset = story.requests[1];
  EXPECT_EQ(reset.operator_request, OperatorRequest::reset);
  EXPECT_TRUE(is_usable(story.before[1])) << "disabled, the arm would fall while the policy is still dead";
  EXPECT_GE(reset.now - *story.stopped_at, milliseconds(500));
  EXPECT_EQ(story.row.rearms, 1U);
  EXPECT_EQ(story.row.safety.entered_damped_stop, 1U) << "an ended stop stays an event";
  EXPECT_TRUE(story.row.success) << story.row.failure_label;
  EXPECT_TRUE(story.row.recovery_s);
}

TEST(Operator, WaitsAsLongAsThePanelSays) {
  const Story story = story_of(seconds(3), "policy_crash", 0.5);
  ASSERT_TRUE(story.stopped_at);
  ASSERT_GE(story.requests.size(), 2U);
  EXPECT_GE(story.requests[1].now - *story.stopped_at, seconds(3));
  EXPECT_LT(story.requests[1].now - *story.stopped_at, seconds(3) + milliseconds(20));
}

TEST(Operator, ClearsAFaultToo) {
  const Story story = story_of(milliseconds(500), "bus_off", 2);
  EXPECT_GE(story.row.safety.entered_fault_latched, 1U);
  EXPECT_GE(story.row.rearms, 1U);
  EXPECT_TRUE(story.row.success) << story.row.failure_label;
}

TEST(Operator, HasNothingToDoInANominalRollout) {
  const Story story = story_of(milliseconds(500), "none");
  EXPECT_EQ(story.requests.size(), 1U);
  EXPECT_EQ(story.row.rearms, 0U);
}

}  // namespace
}  // namespace takt::lab
