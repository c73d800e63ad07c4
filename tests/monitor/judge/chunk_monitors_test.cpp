// SPDX-License-Identifier: Apache-2.0
// Goal: scores of answers are the numbers that their header defines, and a catch is votes of the newest answers, no
// more and no less. Method: answers of a robot with two joints whose scores are known by hand; then a policy that
// begins to contradict itself, tick by tick.
#include "monitor/judge/chunk_monitors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

namespace takt::monitor {
namespace {

using Joints = std::vector<std::array<float, 2>>;  // step by step; one unit is what a joint can do in one step

config::RobotConfig robot_of_two() {
  config::RobotConfig robot;
  robot.joints.resize(2);
  for (config::Joint& joint : robot.joints) joint.limits.velocity = 10;
  robot.policy.emplace();
  robot.policy->step_period = milliseconds(100);
  return robot;
}

CommandChunk chunk_of(const Joints& steps, std::uint64_t answered = 1) {
  CommandChunk chunk;
  chunk.header.observation_id = chunk.header.sequence = answered;
  chunk.header.step_period = milliseconds(100);
  chunk.header.step_count = static_cast<std::uint16_t>(steps.size());
  chunk.header.joint_count = 2;
  chunk.header.fields = static_cast<std::uint8_t>(CommandField::q);
  std::memcpy(chunk.values, steps.data(), steps.size() * sizeof steps[0]);
  return chunk;
}

double of(const ChunkScores& scores, config::ChunkScore score) {
  return scores[static_cast<std::size_t>(score)];
}

ChunkScores alone(const Joints& steps) {
  return ChunkScorer(robot_of_two()).score(chunk_of(steps), MonoTime{0});
}

TEST(ChunkScores, AStraightWayHasNothingStrange) {
  const ChunkScores scores = alone({{0, 0}, {.5F, 0}, {1, 0}, {1.5F, 0}, {2, 0}});
  EXPECT_NEAR(of(scores, config::ChunkScore::velocity), 0.5, 1e-6);
  for (const config::ChunkScore score :
       {config::ChunkScore::temporal_error, config::ChunkScore::reversals, config::ChunkScore::jerk,
        config::ChunkScore::inefficiency, config::ChunkScore::stall})
    EXPECT_NEAR(of(scores, score), 0, 1e-6) << name(score);
}

TEST(ChunkScores, BackAndForthIsReversalAndNoWay) {
  const ChunkScores scores = alone({{0, 0}, {.5F, 0}, {0, 0}, {.5F, 0}, {0, 0}});
  EXPECT_NEAR(of(scores, config::ChunkScore::reversals), 0.5, 1e-9) << "one of two joints turns round at every step";
  EXPECT_NEAR(of(scores, config::ChunkScore::inefficiency), 1, 1e-6);
  // d = +-0.5 of one joint of two: rms 0.354; second differences +-2: rms 1.414.
  EXPECT_NEAR(of(scores, config::ChunkScore::jerk), std::sqrt(2.0) / (0.5 / std::sqrt(2.0) + ChunkScorer::kDeadband),
              1e-5);
}

TEST(ChunkScores, ATurnInsideTheDeadbandIsNone) {
  EXPECT_EQ(of(alone({{0, 0}, {.5F, 0}, {.495F, 0}, {1, 0}}), config::ChunkScore::reversals), 0);
}

TEST(ChunkScores, StandingStillIsStall) {
  EXPECT_NEAR(of(alone({{0, 0}, {0, 0}, {0, 0}, {0, .5F}}), config::ChunkScore::stall), 2.0 / 3, 1e-9);
}

TEST(ChunkScores, TwoAnswersAreComparedAtTheSameInstants) {
  ChunkScorer scorer(robot_of_two());
  EXPECT_EQ(
      of(scorer.score(chunk_of({{0, 0}, {1, 0}, {2, 0}, {3, 0}}), MonoTime{0}), config::ChunkScore::temporal_error), 0);
  // One and a half steps later the earlier answer says 1.5, 2.5 and then nothing.
  const MonoTime later = MonoTime{0} + milliseconds(150);
  EXPECT_NEAR(
      of(scorer.score(chunk_of({{1.5F, 0}, {2.5F, 0}, {9, 9}, {9, 9}}), later), config::ChunkScore::temporal_error), 0,
      1e-6);
  EXPECT_NEAR(
      of(scorer.score(chunk_of({{3.5F, 0}, {4.5F, 0}, {9, 9}, {9, 9}}), later), config::ChunkScore::temporal_error),
      2.0 / std::sqrt(4.0), 1e-6)
      << "two of two joints' eight values are 2 apart";
}

TEST(ChunkScores, AnswersOfOneStepAreAPathTogether) {
  ChunkScorer scorer(robot_of_two());
  ChunkScores newest{};
  for (int answer = 0; answer < 6; ++answer)
    newest = scorer.score(chunk_of({{answer % 2 == 0 ? 0.F : .5F, 0}}), MonoTime{answer});
  EXPECT_NEAR(of(newest, config::ChunkScore::reversals), 0.5, 1e-9);
}

// A policy that is asked in every tick.
class Watched {
 public:
  explicit Watched(config::ChunkMonitors rule) : monitors_(robot_with(std::move(rule))) {
    TickRecordHeader first;
    first.mode = mode;
    first.seats[Seat::policy].session = session;
    first.observation_published = tick_;
    monitors_.tick(first);
  }

  void answer(const Joints& steps, Arrival arrival = Arrival::accepted) {
    TickRecordHeader header;
    header.tick = ++tick_;
    header.now = MonoTime{} + milliseconds(100) * static_cast<std::int64_t>(tick_);
    header.mode = mode;
    header.seats[Seat::policy].session = session;
    header.seats[Seat::policy].arrival = arrival;
    header.observation_published = tick_;
    monitors_.command(chunk_of(steps, tick_ - 1));
    monitors_.tick(header);
  }
  void straight() { answer({{0, 0}, {.1F, 0}, {.2F, 0}, {.3F, 0}}); }
  void torn(Arrival arrival = Arrival::accepted) { answer({{0, 0}, {.5F, 0}, {0, 0}, {.5F, 0}}, arrival); }
  [[nodiscard]] const ChunkMonitors& monitors() const { return monitors_; }

  Mode mode = Mode::tracking;
  std::uint8_t session = 1;

 private:
  static config::RobotConfig robot_with(config::ChunkMonitors rule) {
    config::RobotConfig robot = robot_of_two();
    robot.policy->monitors = std::move(rule);
    return robot;
  }
  ChunkMonitors monitors_;
  std::uint64_t tick_ = 1;
};

config::ChunkMonitors two_of_three() {
  return {.votes = 2, .of = 3, .thresholds = {{config::ChunkScore::reversals, 0.3}}};
}

TEST(ChunkMonitors, ACatchIsVotesOfTheNewest) {
  Watched watched(two_of_three());
  watched.torn();
  watched.straight();
  watched.straight();
  watched.torn();
  EXPECT_EQ(watched.monitors().catch_count(), 0U) << "one of three";
  watched.torn();
  ASSERT_EQ(watched.monitors().catch_count(), 1U);
  const PolicyCatch& caught = watched.monitors().catches().front();
  EXPECT_EQ(caught.score, config::ChunkScore::reversals);
  EXPECT_EQ(caught.tick, 6U);
  EXPECT_EQ(caught.observation, 5U);
  EXPECT_EQ(caught.sentence, "reversals 0.5 or more in 2 of 3 answers, above 0.3; the last one answers observation 5");
  watched.torn();
  EXPECT_EQ(watched.monitors().catch_count(), 1U) << "the same catch goes on";
  for (int i = 0; i < 3; ++i) watched.straight();
  watched.torn();
  watched.torn();
  EXPECT_EQ(watched.monitors().catch_count(), 2U);
}

TEST(ChunkMonitors, TheLevelIsWhatAThresholdBelowItWouldHaveCaught) {
  Watched watched(two_of_three());
  watched.torn();
  EXPECT_EQ(of(watched.monitors().levels(), config::ChunkScore::reversals), 0);
  watched.straight();
  EXPECT_EQ(of(watched.monitors().levels(), config::ChunkScore::reversals), 0) << "one of two reached it";
  watched.torn();
  EXPECT_EQ(of(watched.monitors().levels(), config::ChunkScore::reversals), 0.5);
}

TEST(ChunkMonitors, WhatTheRobotDoesNotFollowIsNotWatched) {
  Watched watched(two_of_three());
  watched.mode = Mode::standby;
  for (int i = 0; i < 5; ++i) watched.torn();
  watched.mode = Mode::tracking;
  for (int i = 0; i < 5; ++i) watched.torn(Arrival::expired_observation);
  EXPECT_EQ(watched.monitors().answers(), 0U);
  watched.torn();
  watched.session = 2;  // another host: nothing of the one before counts
  watched.torn();
  EXPECT_EQ(watched.monitors().catch_count(), 0U);
}

TEST(ChunkMonitors, ADamagedRecordingIsLeftOut) {
  ChunkMonitors monitors(robot_of_two());
  CommandChunk chunk = chunk_of({{0, 0}, {.5F, 0}, {0, 0}, {.5F, 0}});
  TickRecordHeader header;
  header.mode = Mode::tracking;
  header.seats[Seat::policy].arrival = Arrival::accepted;
  header.observation_published = 1;
  monitors.tick(header);
  for (const auto& [steps, joints] : {std::pair{0, 2}, {4, 3}, {200, 2}, {65535, 65535}}) {
    chunk.header.step_count = static_cast<std::uint16_t>(steps);
    chunk.header.joint_count = static_cast<std::uint16_t>(joints);
    RecordedCommand command;
    command.payload.resize(sizeof chunk.header + 16);
    std::memcpy(command.payload.data(), &chunk, command.payload.size());
    monitors.command(command);
    monitors.tick(header);
    monitors.command(chunk);
    monitors.tick(header);
  }
  EXPECT_EQ(monitors.answers(), 0U);
  monitors.command(chunk_of({{0, 0}, {.5F, 0}, {0, 0}, {.5F, 0}}));
  monitors.tick(header);
  EXPECT_EQ(monitors.answers(), 1U) << "a whole one counts";
}

}  // namespace
}  // namespace takt::monitor
