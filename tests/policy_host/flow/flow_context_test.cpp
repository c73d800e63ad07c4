// SPDX-License-Identifier: Apache-2.0
// Goal: a sampler is shown the path that will be played, in the new chunk's own instants. Method: answers with known
// numbers, and observations that say which of them is being played.
#include "policy_host/flow/flow_context.hpp"

#include <gtest/gtest.h>

#include "config/observation_shape.hpp"
#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

class FlowMemoryTest : public testing::Test {
 protected:
  FlowMemoryTest() : robot_(small_robot()) {
    robot_.policy->sampler.emplace();
    robot_.policy->action.joint_of_output = {1};  // 4 steps of 10 ms, one output
  }
  // An observation every 20 ms: two steps.
  Observation observe(std::uint64_t id, std::uint64_t playing, std::uint32_t committed = 0) const {
    Observation observation = small_observation(id);
    observation.command_sequence = playing;
    observation.committed_count = committed;
    return observation;
  }
  FlowContext shown(const FlowMemory& memory, const Observation& observation) {
    values_.assign(config::flow_context_width(robot_), -1.0F);
    memory.show(observation, values_);
    return FlowContext::read(values_, robot_.policy->steps);
  }
  std::vector<float> path(const FlowMemory& memory, const Observation& observation) {
    const FlowContext context = shown(memory, observation);
    return {context.path.begin(), context.path.end()};
  }

  config::RobotConfig robot_;
  std::vector<float> values_;
  const std::vector<float> answer_{90, 95, 103, 95};
};

TEST_F(FlowMemoryTest, ThePathIsShiftedByWhatWasPlayedAndItsLastStepStandsOn) {
  FlowMemory memory(robot_, PathOwner::policy);
  memory.remember(1, observe(1, 0), answer_);
  const FlowContext context = shown(memory, observe(2, 1, 1));
  EXPECT_EQ(context.observation_id, 2U);
  EXPECT_EQ(context.promised, 1U);
  EXPECT_EQ(context.known, 2U);
  EXPECT_EQ(context.kept(), 2U) << "and one more";
  EXPECT_EQ(path(memory, observe(2, 1, 1)), (std::vector<float>{103, 95, 95, 95})) << "never zeros";
}

TEST_F(FlowMemoryTest, BetweenTwoStepsThePathIsWhereItIsPlayed) {
  FlowMemory memory(robot_, PathOwner::policy);
  memory.remember(1, observe(1, 0), answer_);
  Observation between = observe(2, 1);
  between.published_at = between.published_at - milliseconds(5);
  EXPECT_EQ(path(memory, between), (std::vector<float>{99, 99, 95, 95}));
  robot_.policy->action.interpolation = config::Interpolation::hold;
  FlowMemory held(robot_, PathOwner::policy);
  held.remember(1, observe(1, 0), answer_);
  between.published_at = between.published_at - milliseconds(1);
  EXPECT_EQ(path(held, between), (std::vector<float>{95, 103, 95, 95}));
  for (const Duration jitter : {Duration{} - microseconds(30), Duration{}, microseconds(30)}) {
    Observation jittered = observe(2, 1);
    jittered.published_at = jittered.published_at + jitter;
    EXPECT_EQ(path(held, jittered), (std::vector<float>{103, 95, 95, 95}))
        << "a step's jump for " << jitter.ns << " ns";
  }
}

TEST_F(FlowMemoryTest, MoreCannotBePromisedThanIsKnown) {
  FlowMemory memory(robot_, PathOwner::policy);
  memory.remember(1, observe(1, 0), answer_);
  EXPECT_EQ(shown(memory, observe(2, 1, 9)).promised, 2U);
  EXPECT_EQ(shown(memory, observe(2, 1, 9)).kept(), 2U) << "nor kept";
  EXPECT_EQ(shown(memory, observe(2, 1, 0)).kept(), 0U) << "nothing promised, nothing to keep";
  EXPECT_EQ(shown(memory, observe(3, 1, 9)).known, 0U) << "spent";
  EXPECT_EQ(path(memory, observe(3, 1)), std::vector<float>(4, 0.0F)) << "and nothing is known";
}

TEST_F(FlowMemoryTest, OfAShorterChunkNoMoreIsKnown) {
  FlowMemory memory(robot_, PathOwner::policy);
  memory.remember(1, observe(1, 0), std::span(answer_).first(3));
  EXPECT_EQ(shown(memory, observe(2, 1)).known, 1U);
  EXPECT_EQ(path(memory, observe(2, 1)), (std::vector<float>{103, 103, 103, 103}));
}

TEST_F(FlowMemoryTest, ARelativeTargetIsSaidInRelationToWhereTheJointIsNow) {
  robot_.policy->action.offset = config::OffsetKind::measured;
  robot_.policy->action.scale = {0.5};
  FlowMemory memory(robot_, PathOwner::policy);
  memory.remember(1, observe(1, 0), answer_);
  Observation later = observe(2, 1);
  later.q[1] += 2.0F;  // the joint went 2 rad on: the same target is 4 outputs less
  EXPECT_EQ(path(memory, later), (std::vector<float>{99, 91, 91, 91}));
}

TEST_F(FlowMemoryTest, WhatIsPlayedIsAskedForByItsSequence) {
  FlowMemory memory(robot_, PathOwner::policy);
  memory.remember(1, observe(1, 0), answer_);
  memory.remember(2, observe(2, 1), std::vector<float>{1, 2, 3, 4});
  EXPECT_EQ(path(memory, observe(2, 1)), (std::vector<float>{103, 95, 95, 95}));
  EXPECT_EQ(path(memory, observe(3, 2)), (std::vector<float>{3, 4, 4, 4}));
  EXPECT_EQ(shown(memory, observe(3, 0)).known, 0U) << "nothing of this session is played";
  EXPECT_EQ(shown(memory, observe(3, 17)).known, 0U) << "never answered";
  for (std::uint64_t sequence = 3; sequence <= 18; ++sequence) memory.remember(sequence, observe(3, 2), answer_);
  EXPECT_EQ(shown(memory, observe(3, 2)).known, 0U) << "forgotten, and sequence 18 stands in its place";
  memory.start_session();
  EXPECT_EQ(shown(memory, observe(4, 18)).known, 0U) << "another session's";
}

TEST_F(FlowMemoryTest, AnotherPolicysPathIsNotOurs) {
  const auto known = [&](PathOwner owner, bool candidate) {
    FlowMemory memory(robot_, owner);
    memory.remember(1, observe(1, 0), answer_);
    Observation observation = observe(2, 1);
    observation.of_candidate = candidate ? 1 : 0;
    return shown(memory, observation).known;
  };
  EXPECT_EQ(known(PathOwner::policy, false), 2U);
  EXPECT_EQ(known(PathOwner::policy, true), 0U);
  EXPECT_EQ(known(PathOwner::candidate, true), 2U);
  EXPECT_EQ(known(PathOwner::candidate, false), 0U);
  EXPECT_EQ(known(PathOwner::nobody, false), 0U);
}

TEST_F(FlowMemoryTest, ANewestAnswerIsAwaitedUntilItIsPlayedOrItsChunkWouldBeSpent) {
  FlowMemory memory(robot_, PathOwner::policy);
  EXPECT_FALSE(memory.awaits(observe(1, 0)));
  memory.remember(1, observe(1, 0), answer_);
  EXPECT_TRUE(memory.awaits(observe(2, 0)));
  EXPECT_FALSE(memory.awaits(observe(2, 1)));
  EXPECT_FALSE(memory.awaits(observe(3, 0))) << "40 ms on: it was refused, or lost";
  memory.start_session();
  EXPECT_FALSE(memory.awaits(observe(2, 0)));
}

TEST_F(FlowMemoryTest, LargeIdsComeThroughWhole) {
  FlowMemory memory(robot_, PathOwner::policy);
  Observation observation = observe(1, 0);
  observation.id = 0xFEDCBA9876543ULL;
  EXPECT_EQ(shown(memory, observation).observation_id, observation.id);
}

}  // namespace
}  // namespace takt::policy_host
