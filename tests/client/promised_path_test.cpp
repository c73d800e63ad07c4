// SPDX-License-Identifier: Apache-2.0
// Goal: what a policy is told of the path that will be played whatever it answers is that path, at the instants of its
// answer's steps: whatever clocks jitter, however steps are joined, at a chunk's end; and only of chunks that this
// policy published in this session. Method: chunks whose values say where they belong, observations as the executive
// writes them; PromisedPath alone.
#include "client/promised_path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "config/load.hpp"

namespace takt::client {
namespace {

constexpr std::size_t kJoints = 6, kSteps = 16;
constexpr Duration kStep = milliseconds(10);
constexpr MonoTime kBegins{5'000'000'000};

config::RobotConfig robot_with(config::Interpolation interpolation, config::JoinKind join = config::JoinKind::prefix) {
  auto robot = config::load("config/arm6.yaml").value();
  robot.policy->action.interpolation = interpolation;
  robot.policy->action.join.kind = join;
  return robot;
}

// Where a cubic path is `at` so many steps after its first one, of one joint, and how fast it is then.
double position(double at, std::size_t joint) {
  return 0.01 * static_cast<double>(joint) + 0.02 * at - 0.003 * at * at + 0.0002 * at * at * at;
}
double velocity(double at) {
  return (0.02 - 0.006 * at + 0.0006 * at * at) / kStep.seconds();
}

CommandChunk chunk_of(const std::vector<float>& q, const std::vector<float>& dq = {}) {
  CommandChunk chunk;
  chunk.header.step_count = kSteps;
  chunk.header.joint_count = kJoints;
  chunk.header.fields = static_cast<std::uint8_t>(CommandField::q);
  if (!dq.empty()) chunk.header.fields |= static_cast<std::uint8_t>(CommandField::dq);
  for (std::size_t i = 0; i < q.size(); ++i) {
    chunk.values[value_index(chunk.header, CommandField::q, i / kJoints, i % kJoints)] = q[i];
    if (!dq.empty()) chunk.values[value_index(chunk.header, CommandField::dq, i / kJoints, i % kJoints)] = dq[i];
  }
  return chunk;
}

class Promised : public testing::Test {
 protected:
  void begin(config::Interpolation interpolation, config::JoinKind join = config::JoinKind::prefix) {
    path_.emplace(robot_with(interpolation, join));
  }
  // A chunk whose every value is `first` and its step.
  void publish(std::uint64_t sequence, MonoTime begins = kBegins, float first = 0.0F) {
    std::vector<float> q(kSteps * kJoints);
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = first + static_cast<float>(i / kJoints);
    path_->remember({sequence, begins + microseconds(500), begins}, chunk_of(q));
  }
  // What an observation shows that was published `since` the first step's instant of publish `sequence`.
  const float* show(Duration since, std::uint32_t count, std::uint64_t sequence = 1) {
    Observation observation;
    observation.published_at = kBegins + since;
    observation.command_sequence = sequence;
    observation.committed_from = static_cast<std::uint32_t>(since.ns / kStep.ns);
    observation.committed_count = count;
    return path_->show(observation);
  }
  void expect_rows(const float* rows, const std::vector<float>& wanted) {
    ASSERT_NE(rows, nullptr);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      for (std::size_t joint = 0; joint < kJoints; ++joint)
        EXPECT_NEAR(rows[i * kJoints + joint], wanted[i], 1e-4F) << "row " << i << ", joint " << joint;
  }

  std::optional<PromisedPath> path_;
};

TEST_F(Promised, RowsAreThePathAtTheInstantsOfTheAnswersSteps) {
  begin(config::Interpolation::linear);
  publish(1);
  expect_rows(show(milliseconds(20), 3), {2.0F, 3.0F, 4.0F});
  expect_rows(show(milliseconds(25), 2), {2.5F, 3.5F});
  // The step being played is another 30 us before its neighbour's instant and 30 us after it; the rows are the same.
  expect_rows(show(milliseconds(20) - microseconds(30), 3), {1.997F, 2.997F, 3.997F});
  expect_rows(show(milliseconds(20) + microseconds(30), 3), {2.003F, 3.003F, 4.003F});
}

TEST_F(Promised, HeldStepsAreThoseThatArePlayedForMostOfARow) {
  begin(config::Interpolation::hold);
  publish(1);
  expect_rows(show(milliseconds(20) - microseconds(30), 3), {2.0F, 3.0F, 4.0F});
  expect_rows(show(milliseconds(20) + microseconds(30), 3), {2.0F, 3.0F, 4.0F});
  expect_rows(show(milliseconds(24), 2), {2.0F, 3.0F});
  expect_rows(show(milliseconds(26), 2), {3.0F, 4.0F});
}

TEST_F(Promised, ACubicPathIsReadByItsVelocities) {
  begin(config::Interpolation::cubic);
  std::vector<float> q(kSteps * kJoints), dq(kSteps * kJoints);
  for (std::size_t i = 0; i < q.size(); ++i) {
    const auto at = static_cast<double>(i / kJoints);
    q[i] = static_cast<float>(position(at, i % kJoints));
    dq[i] = static_cast<float>(velocity(at));
  }
  path_->remember({1, kBegins, kBegins}, chunk_of(q, dq));
  const float* const rows = show(milliseconds(23), 4);
  ASSERT_NE(rows, nullptr);
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t joint = 0; joint < kJoints; ++joint)
      EXPECT_NEAR(rows[i * kJoints + joint], position(2.3 + static_cast<double>(i), joint), 1e-5);
}

// As the executive plays it: never zeros, never beyond the last step.
TEST_F(Promised, AtItsEndAChunkStandsOnItsLastStep) {
  for (const config::Interpolation how : {config::Interpolation::linear, config::Interpolation::hold}) {
    begin(how);
    publish(1);
    expect_rows(show(milliseconds(147), 2), {how == config::Interpolation::linear ? 14.7F : 15.0F, 15.0F});
    expect_rows(show(milliseconds(157), 1), {15.0F});
  }
}

TEST_F(Promised, NothingIsShownThatIsNotPromisedOrNotKnown) {
  begin(config::Interpolation::linear);
  publish(1);
  EXPECT_EQ(show(milliseconds(20), 0), nullptr) << "none promised";
  EXPECT_EQ(show(milliseconds(20), 2, 0), nullptr) << "no chunk of this session";
  EXPECT_EQ(show(milliseconds(20), 2, 7), nullptr) << "never published";
  EXPECT_NE(show(milliseconds(20), 2), nullptr);
  path_->start_session();
  EXPECT_EQ(show(milliseconds(20), 2), nullptr) << "published in an earlier session";
  begin(config::Interpolation::linear, config::JoinKind::cross_fade);
  publish(1);
  EXPECT_EQ(show(milliseconds(20), 2), nullptr) << "that join promises nothing";
}

// A policy whose answers are refused, or that publishes often, leaves an older chunk in use.
TEST_F(Promised, TheChunkThatIsFollowedIsRememberedAndTheNewest) {
  begin(config::Interpolation::linear);
  publish(1, kBegins, 100.0F);
  ASSERT_NE(show(milliseconds(20), 1), nullptr);
  for (std::uint64_t sequence = 2; sequence <= 200; ++sequence) publish(sequence, kBegins, 1000.0F);
  expect_rows(show(milliseconds(20), 1), {102.0F});
  EXPECT_EQ(show(milliseconds(20), 1, 200 - PromisedPath::kRemembered), nullptr);
  expect_rows(show(milliseconds(20), 1, 201 - PromisedPath::kRemembered), {1002.0F});
}

// An answer that came too late for this observation to know of it is taken at once.
TEST_F(Promised, ALateAnswerIsWhatWillBePlayed) {
  begin(config::Interpolation::linear);
  publish(1);
  publish(2, kBegins + milliseconds(20), 50.0F);   // half a millisecond after that
  expect_rows(show(milliseconds(40), 1), {4.0F});  // the executive knew it, and did not take it
  const Duration before_it_came = milliseconds(20) + microseconds(400);
  expect_rows(show(before_it_came, 2), {50.04F, 51.04F});
}

// In lockstep no clock tells: the observation does.
TEST_F(Promised, InLockstepTheObservationSaysWhetherItKnewTheNewestAnswer) {
  begin(config::Interpolation::linear);
  publish(1);
  std::vector<float> q(kSteps * kJoints, 50.0F);
  path_->remember({2, {}, kBegins + milliseconds(20)}, chunk_of(q));
  Observation observation;
  observation.published_at = kBegins + milliseconds(30);
  observation.command_sequence = 1;
  observation.committed_count = 1;
  expect_rows(path_->show(observation), {3.0F});
  observation.overtaken = 1;
  expect_rows(path_->show(observation), {50.0F});
}

}  // namespace
}  // namespace takt::client
