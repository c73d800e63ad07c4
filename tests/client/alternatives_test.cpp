// SPDX-License-Identifier: Apache-2.0
// Goal: of the chunks that a policy gave for states that are not there yet the nearest that came true is published,
// with every target at the instant that it was meant for and as old as what it rests on; what did not, or comes too
// late, is gone and counted. Method: one joint, observations by hand; Alternatives alone.
#include "client/alternatives.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "config/load.hpp"

namespace takt::client {
namespace {

constexpr MonoTime kStart{1'000'000'000};
constexpr Duration kStep = milliseconds(10), kPeriod = milliseconds(20);

class AlternativesTest : public testing::Test {
 protected:
  void begin(config::Interpolation interpolation = config::Interpolation::linear,
             config::JointKind kind = config::JointKind::hinge) {
    config::RobotConfig robot = config::load("config/arm6.yaml").value();
    robot.joints.resize(1);
    robot.joints[0].kind = kind;
    if (kind == config::JointKind::slide) robot.joints[0].drive.gear_ratio = 100;
    robot.policy->steps = 4;
    robot.policy->action.interpolation = interpolation;
    robot.policy->speculation = config::Speculation{.position = 0.1, .velocity = 1.0};
    robot.freshness.max_age = milliseconds(100);
    waiting_.emplace(robot);
  }
  // For `ahead` after the start: the joint at `q`. Its targets are `first` and so on, one more per step.
  void keep(Duration ahead, float q, float first, const float* dq = nullptr, std::uint64_t observation = 1) {
    CommandHeader& header = chunk_->header;
    header.observation_id = observation;
    header.step_count = 4;
    header.joint_count = 1;
    header.step_period = kStep;
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    for (std::size_t k = 0; k < 4; ++k) chunk_->values[k] = first + static_cast<float>(k);
    const takt_assumption assumption{sizeof assumption, 0, (kStart + ahead).ns, &q, dq};
    waiting_->keep(*chunk_, rests_on_, assumption);
  }
  bool match(Duration since, float q, float dq = 0, std::uint64_t answered = 0) {
    Observation observation;
    observation.id = 2;
    observation.published_at = kStart + since;
    observation.period = kPeriod;
    observation.q[0] = q;
    observation.dq[0] = dq;
    return waiting_->match(observation, answered, *answer_, sensed_at_);
  }
  void expect_counts(std::uint64_t taken, std::uint64_t outdone, std::uint64_t unmatched, std::uint64_t dropped) {
    const takt_alternatives& counts = waiting_->counts();
    EXPECT_EQ(counts.taken, taken);
    EXPECT_EQ(counts.outdone, outdone);
    EXPECT_EQ(counts.unmatched, unmatched);
    EXPECT_EQ(counts.dropped, dropped);
  }

  std::optional<Alternatives> waiting_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>(), answer_ = std::make_unique<CommandChunk>();
  MonoTime sensed_at_, rests_on_ = kStart - milliseconds(1);
};

// Goal: how near is of a slide's motor. Method: 100 rad to a metre, so that 0.1 rad are 1 mm and 1 rad/s 10 mm/s; a
// little less and a little more of each.
TEST_F(AlternativesTest, OfASlideNearIsOfItsMotor) {
  begin(config::Interpolation::linear, config::JointKind::slide);
  keep(kPeriod, 0.0011F, 100);
  EXPECT_FALSE(match(kPeriod, 0.0F));
  keep(kPeriod, 0.0009F, 100);
  EXPECT_TRUE(match(kPeriod, 0.0F));
  float dq = 0.011F;
  keep(kPeriod, 0.0F, 100, &dq);
  EXPECT_FALSE(match(kPeriod, 0.0F));
  dq = 0.009F;
  keep(kPeriod, 0.0F, 100, &dq);
  EXPECT_TRUE(match(kPeriod, 0.0F));
}

TEST_F(AlternativesTest, TheNearestThatMatchesIsTaken) {
  begin();
  keep(kPeriod, 0.25F, 100);
  keep(kPeriod, 0.06F, 200);
  keep(kPeriod, 0.02F, 300);
  EXPECT_FALSE(match(milliseconds(19), 0.0F)) << "its instant has not come";
  ASSERT_TRUE(match(kPeriod, 0.0F));
  EXPECT_EQ(answer_->values[0], 300.0F);
  EXPECT_EQ(sensed_at_, kStart - milliseconds(1));
  expect_counts(1, 1, 1, 0);
  EXPECT_FALSE(match(kPeriod + milliseconds(1), 0.0F)) << "nothing waits any more";
}

TEST_F(AlternativesTest, EveryTargetStaysAtItsInstant) {
  begin();
  keep(milliseconds(13), 0.0F, 100);
  ASSERT_TRUE(match(kPeriod, 0.0F)) << "7 ms after it";
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_NEAR(answer_->values[k], std::min(100.7F + static_cast<float>(k), 103.0F), 1e-4F) << k;
  begin(config::Interpolation::hold);
  keep(milliseconds(13), 0.0F, 100);
  ASSERT_TRUE(match(kPeriod, 0.0F));
  EXPECT_EQ(answer_->values[0], 100.0F);
}

TEST_F(AlternativesTest, VelocitiesCountWhereTheyAreAssumed) {
  begin();
  const float fast = 3.0F, still = 0.5F;
  keep(kPeriod, 0.0F, 100, &fast);
  EXPECT_FALSE(match(kPeriod, 0.0F, 0.0F));
  keep(kPeriod * 2, 0.0F, 100, &still);
  EXPECT_TRUE(match(kPeriod * 2, 0.0F, 0.0F));
  keep(kPeriod * 3, std::numeric_limits<float>::quiet_NaN(), 100);
  EXPECT_FALSE(match(kPeriod * 3, 0.0F)) << "no state at all";
  expect_counts(1, 0, 2, 0);
}

TEST_F(AlternativesTest, WhatComesTooLateIsDropped) {
  begin();
  keep(kPeriod, 0.0F, 100);
  EXPECT_FALSE(match(kPeriod * 2, 0.0F)) << "its observation was missed";
  keep(kPeriod * 3, 0.0F, 100);
  EXPECT_FALSE(match(kPeriod * 3, 0.0F, 0.0F, 2)) << "an answer to a newer observation went out";
  keep(milliseconds(101), 0.0F, 100);
  EXPECT_FALSE(match(milliseconds(101), 0.0F)) << "older than max_age";
  keep(milliseconds(60), 0.0F, 100);
  waiting_->drop_all();
  EXPECT_FALSE(match(milliseconds(60), 0.0F));
  expect_counts(0, 0, 0, 4);
}

TEST_F(AlternativesTest, TheOldestGoesWhenOneMoreComesThanMayWait) {
  begin();
  keep(kPeriod, 0.0F, 100);
  for (std::size_t i = 0; i < Alternatives::kMost; ++i) keep(kPeriod, 0.5F, 200);
  EXPECT_FALSE(match(kPeriod, 0.0F));
  expect_counts(0, 0, Alternatives::kMost, 1);
}

// Whatever is kept and whenever it is looked at, each one ends in one of the counts.
TEST_F(AlternativesTest, EachIsCountedOnce) {
  begin();
  std::mt19937 random(5);
  Duration now;
  for (int round = 0; round < 20'000; ++round) {
    rests_on_ = kStart + now;
    if (random() % 2 == 0)
      keep(now + milliseconds(static_cast<std::int64_t>(random() % 70)), 0.01F * static_cast<float>(random() % 30),
           static_cast<float>(round));
    now = now + milliseconds(static_cast<std::int64_t>(random() % 25));
    const bool is_taken = match(now, 0.01F * static_cast<float>(random() % 30), 0.0F, random() % 20 == 0 ? 2 : 0);
    if (is_taken) {
      ASSERT_LE((kStart + now - sensed_at_).ns, milliseconds(100).ns);
    }
    if (random() % 300 == 0) waiting_->drop_all();
  }
  waiting_->drop_all();
  const takt_alternatives& counts = waiting_->counts();
  EXPECT_EQ(counts.kept, counts.taken + counts.outdone + counts.unmatched + counts.dropped);
  EXPECT_GT(counts.kept, 5000U);
}

}  // namespace
}  // namespace takt::client
