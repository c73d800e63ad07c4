// SPDX-License-Identifier: Apache-2.0
// Goal: each kind of bad message is refused by its own name, in the documented order, and no message can make itself
// younger. Method: one sound message, one thing spoilt at a time; pairs of faults for the order.
#include "executive/pipeline/arrival.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string_view>
#include <vector>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

constexpr MonoTime kSensed{1'000'000'000}, kPublished{1'001'000'000}, kNow{1'030'000'000};
constexpr std::uint64_t kLastSequence = 41;

struct Case {
  TickConfig config = testing::robot(3);
  ObservationMemory memory;
  CommandInUse in_use;
  CommandChunk chunk;
  std::size_t bytes = 0;
  MonoTime now = kNow;

  Case() {
    config.policy.hash = 77;
    for (int i = 0; i < 100; ++i)
      memory.remember({kSensed - milliseconds(99 - i), kPublished - milliseconds(99 - i)},
                      remembered_observations(config));
    chunk = testing::chunk_for(config, 100, kPublished, kNow, kLastSequence + 1, 0.1F, 4);
    bytes = chunk.used_bytes();
  }
  [[nodiscard]] ArrivalVerdict judge() const {
    return judge_arrival(chunk, bytes, now, {config.policy, kLastSequence, in_use}, memory, config);
  }
  void give(CommandField field, float value) {
    chunk.header.fields = static_cast<std::uint8_t>(chunk.header.fields | static_cast<unsigned>(field));
    for (std::size_t i = 0; i < chunk.value_count(); ++i) chunk.values[i] = 0.0F;
    chunk.values[value_index(chunk.header, field, 3, 2)] = value;
    bytes = chunk.used_bytes();
  }
};

TEST(Arrival, ASoundMessageIsAccepted) {
  const ArrivalVerdict verdict = Case{}.judge();
  EXPECT_EQ(verdict.arrival, Arrival::accepted);
  EXPECT_FALSE(verdict.stamps_ran_backwards);
  EXPECT_EQ(verdict.command.sensed_at, kSensed);
  EXPECT_EQ(verdict.command.observed_at, kPublished);
  EXPECT_EQ(verdict.command.age_parts(kNow).total(), kNow - kSensed);
}

struct Spoilt {
  std::string_view when;
  Arrival expected;
  std::function<void(Case&)> spoil;
};

// In the order of the checks: each row must win over all rows below it that spoil something else.
const std::vector<Spoilt>& spoilt_messages() {
  static const std::vector<Spoilt> rows{
      {"no bytes", Arrival::wrong_shape, [](Case& c) { c.bytes = 0; }},
      {"header only", Arrival::wrong_shape, [](Case& c) { c.bytes = sizeof(CommandHeader); }},
      {"one byte short", Arrival::wrong_shape, [](Case& c) { c.bytes -= 1; }},
      {"one byte long", Arrival::wrong_shape, [](Case& c) { c.bytes += 1; }},
      {"no steps", Arrival::wrong_shape, [](Case& c) { c.chunk.header.step_count = 0; }},
      {"a step too many", Arrival::wrong_shape, [](Case& c) { c.chunk.header.step_count = kMaxChunkSteps + 1; }},
      {"a joint too many", Arrival::wrong_shape, [](Case& c) { c.chunk.header.joint_count = 4; }},
      {"no q", Arrival::wrong_shape, [](Case& c) { c.chunk.header.fields = 2; }},
      {"unknown field", Arrival::wrong_shape, [](Case& c) { c.chunk.header.fields |= 32; }},
      {"reserved byte set", Arrival::wrong_shape, [](Case& c) { c.chunk.header.reserved[5] = 1; }},
      {"velocities on straight lines", Arrival::wrong_shape, [](Case& c) { c.give(CommandField::dq, 0.1F); }},
      {"cubics without velocities", Arrival::wrong_shape,
       [](Case& c) { c.config.interpolation = Interpolation::cubic; }},
      {"no step period", Arrival::wrong_shape, [](Case& c) { c.chunk.header.step_period = {}; }},
      {"negative step period", Arrival::wrong_shape, [](Case& c) { c.chunk.header.step_period = {-1}; }},
      {"huge step period", Arrival::wrong_shape, [](Case& c) { c.chunk.header.step_period = {INT64_MAX}; }},
      {"another policy", Arrival::wrong_policy, [](Case& c) { c.chunk.header.policy_hash = 78; }},
      {"same sequence", Arrival::repeated_sequence, [](Case& c) { c.chunk.header.sequence = kLastSequence; }},
      {"older sequence", Arrival::repeated_sequence, [](Case& c) { c.chunk.header.sequence = 0; }},
      {"no observation", Arrival::unknown_observation, [](Case& c) { c.chunk.header.observation_id = 0; }},
      {"next observation", Arrival::future_observation, [](Case& c) { c.chunk.header.observation_id = 101; }},
      {"far observation", Arrival::future_observation, [](Case& c) { c.chunk.header.observation_id = UINT64_MAX; }},
      {"just forgotten", Arrival::expired_observation, [](Case& c) { c.chunk.header.observation_id = 93; }},
      {"sensors without a stamp", Arrival::missing_stamp, [](Case& c) { c.config.policy.needs_outside_stamp = true; }},
      {"sensor ahead of now", Arrival::future_observation,
       [](Case& c) { c.chunk.header.outside_sensed_at = kNow + c.config.period + nanoseconds(1); }},
      {"published ahead of now", Arrival::future_observation,
       [](Case& c) { c.chunk.header.published_at = {INT64_MAX}; }},
      {"not a number", Arrival::not_finite, [](Case& c) { c.chunk.values[5] = NAN; }},
      {"infinite", Arrival::not_finite, [](Case& c) { c.chunk.values[11] = -INFINITY; }},
      {"no joint's target", Arrival::out_of_range, [](Case& c) { c.chunk.values[0] = -1.1F * kLargestTarget; }},
      {"no joint's torque", Arrival::out_of_range, [](Case& c) { c.give(CommandField::tau_ff, 1e30F); }},
      {"older than max_age", Arrival::expired_observation,
       [](Case& c) { c.now = kSensed + milliseconds(100) + nanoseconds(1); }},
      {"sensor older than max_age", Arrival::expired_observation,
       [](Case& c) { c.chunk.header.outside_sensed_at = kNow - milliseconds(101); }},
      {"sensor before time began", Arrival::expired_observation,
       [](Case& c) { c.chunk.header.outside_sensed_at = {INT64_MIN}; }},
      {"older than the one in use", Arrival::overtaken,
       [](Case& c) {
         c.in_use.observation_id = 100;
         c.chunk.header.observation_id = 99;
       }},
  };
  return rows;
}

TEST(Arrival, EachFaultHasItsName) {
  for (const Spoilt& row : spoilt_messages()) {
    Case message;
    row.spoil(message);
    EXPECT_EQ(name(message.judge().arrival), name(row.expected)) << row.when;
  }
}

TEST(Arrival, WhatIsJustAtALimitIsAccepted) {
  for (const float torque : {-20.0F, 20.0F}) {
    Case message;
    for (JointConfig& joint : message.config.joints) joint.limits.torque = 20;
    message.give(CommandField::tau_ff, torque);
    EXPECT_EQ(name(message.judge().arrival), name(Arrival::accepted)) << torque;
  }
}

TEST(Arrival, ChecksRunInTheDocumentedOrder) {
  // Shape before policy before sequence before observation before stamps before values.
  const std::vector<std::pair<std::string_view, std::string_view>> pairs{
      {"unknown field", "another policy"},
      {"another policy", "same sequence"},
      {"same sequence", "no observation"},
      {"just forgotten", "sensors without a stamp"},
      {"sensors without a stamp", "published ahead of now"},
      {"sensor ahead of now", "infinite"},
      {"not a number", "no joint's target"},
      {"no joint's target", "sensor older than max_age"},
      {"sensor older than max_age", "older than the one in use"}};
  const auto row = [](std::string_view when) -> const Spoilt& {
    for (const Spoilt& candidate : spoilt_messages())
      if (candidate.when == when) return candidate;
    throw std::logic_error("no such row");
  };
  for (const auto& [first, second] : pairs) {
    Case message;
    row(second).spoil(message);
    row(first).spoil(message);
    EXPECT_EQ(name(message.judge().arrival), name(row(first).expected)) << first << " and " << second;
  }
}

TEST(Arrival, WhatExceedsAJointsRangeIsAcceptedAndLeftToThePlayer) {
  Case message;
  message.chunk.values[0] = 100.0F;
  EXPECT_EQ(message.judge().arrival, Arrival::accepted);
  message.give(CommandField::kp, -1.0F);
  EXPECT_EQ(message.judge().arrival, Arrival::accepted);
  message.config.interpolation = Interpolation::hold;
  message.give(CommandField::dq, 100.0F);
  EXPECT_EQ(message.judge().arrival, Arrival::accepted) << "held steps may have velocities";
  message.now = kSensed + milliseconds(100);
  EXPECT_EQ(message.judge().arrival, Arrival::accepted) << "exactly max_age old";
  message.now = message.chunk.header.published_at - message.config.period;
  EXPECT_EQ(message.judge().arrival, Arrival::accepted) << "published between the tick's wake-up and its look";
  EXPECT_EQ(message.judge().command.age_parts(message.now).total(), message.now - kSensed);
}

TEST(Arrival, OutsideSensorsOnlyMakeOlder) {
  Case message;
  message.chunk.header.outside_sensed_at = kPublished;  // younger than the observation
  EXPECT_EQ(message.judge().command.sensed_at, kSensed);
  message.chunk.header.outside_sensed_at = kSensed - milliseconds(30);
  EXPECT_EQ(message.judge().command.sensed_at, kSensed - milliseconds(30));
}

TEST(Arrival, BackwardStampsAreClampedAndCounted) {
  const std::vector<std::pair<MonoTime, MonoTime>> claims{
      {{0}, {0}}, {{INT64_MIN}, kNow}, {kNow, kPublished}, {kPublished - nanoseconds(1), kNow}};
  for (const auto& [started, ended] : claims) {
    Case message;
    message.chunk.header.infer_started_at = started;
    message.chunk.header.infer_ended_at = ended;
    const ArrivalVerdict verdict = message.judge();
    EXPECT_EQ(verdict.arrival, Arrival::accepted);
    EXPECT_TRUE(verdict.stamps_ran_backwards);
    const AgeParts parts = verdict.command.age_parts(kNow);
    EXPECT_GE(parts.queue.ns, 0);
    EXPECT_GE(parts.infer.ns, 0);
    EXPECT_GE(parts.publish.ns, 0);
    EXPECT_EQ(parts.total(), kNow - kSensed);
  }
}

TEST(Arrival, ASecondAnswerToTheSameObservationIsNotOvertaken) {
  Case message;
  message.in_use.observation_id = 100;
  EXPECT_EQ(message.judge().arrival, Arrival::accepted);
}

TEST(Arrival, AStampOfOutsideSensorsIsAskedForWhereThePolicyUsesThem) {
  Case message;
  message.config.policy.needs_outside_stamp = true;
  message.chunk.header.outside_sensed_at = kSensed - milliseconds(30);
  EXPECT_EQ(message.judge().arrival, Arrival::accepted);
  EXPECT_EQ(message.judge().command.sensed_at, kSensed - milliseconds(30));
}

TEST(ObservationMemory, RemembersAsManyAsItIsDeep) {
  constexpr std::uint32_t kDepth = 64;
  ObservationMemory memory;
  RememberedObservation found;
  EXPECT_EQ(memory.recall(1, kDepth, found), ObservationMemory::Recall::not_yet_published);
  for (std::int64_t i = 1; i <= 1000; ++i) {
    EXPECT_EQ(memory.remember({{i}, {i + 1}}, kDepth), static_cast<std::uint64_t>(i));
    for (std::uint64_t id = 1; id <= static_cast<std::uint64_t>(i); ++id) {
      const bool known = id + kDepth > static_cast<std::uint64_t>(i);
      ASSERT_EQ(memory.recall(id, kDepth, found) == ObservationMemory::Recall::known, known) << id << " of " << i;
      if (known) {
        ASSERT_EQ(found.oldest_sensed_at.ns, static_cast<std::int64_t>(id));
      }
    }
  }
}

// Goal: no observation is forgotten before it is max_age old, at any rate, with wake-ups as uneven as they can be.
// Method: ticks that are published as late as the grid allows, then in time; every id that is young enough is recalled.
TEST(ObservationMemory, ForgetsNothingThatIsYoungerThanMaxAge) {
  for (const std::uint32_t every_ticks : {1U, 2U, 7U, 20U, 100U}) {
    TickConfig config = testing::robot(1);
    config.observation_every_ticks = every_ticks;
    const std::uint32_t depth = remembered_observations(config);
    ObservationMemory memory;
    std::vector<MonoTime> published_at{MonoTime{}};
    for (std::uint64_t tick = 0; tick < 1000; ++tick) {
      const bool late = tick / 150 % 2 == 0;
      const MonoTime now = kSensed + config.period * static_cast<std::int64_t>(tick) +
                           (late ? config.period - nanoseconds(1) : Duration{});
      RememberedObservation found;
      for (std::uint64_t id = 1; id < published_at.size(); ++id) {
        if (now - published_at[id] > config.freshness.max_age) continue;
        ASSERT_EQ(memory.recall(id, depth, found), ObservationMemory::Recall::known)
            << id << " at tick " << tick << ", every " << every_ticks;
        ASSERT_EQ(found.published_at, published_at[id]);
      }
      if (tick % every_ticks != 0) continue;
      memory.remember({now, now}, depth);
      published_at.push_back(now);
    }
  }
}

// Who asks what a larger max_age would have decided goes on from a state that remembered fewer observations.
TEST(ObservationMemory, OnceDeepenedItForgetsNothingMoreAndRecallsNothingForgotten) {
  constexpr std::uint32_t kBefore = 5, kAfter = 12, kMany = 23;
  ObservationMemory memory;
  const auto publish = [&](std::uint64_t ordinal, std::uint32_t depth) {
    memory.remember({MonoTime{static_cast<std::int64_t>(ordinal)}, {}}, depth);
  };
  for (std::uint64_t id = 1; id <= kMany; ++id) publish(id, kBefore);
  memory.deepen(kBefore, kAfter);
  for (std::uint64_t id = kMany + 1; id <= kMany + 7; ++id) publish(id, kAfter);
  RememberedObservation found;
  for (std::uint64_t id = 1; id <= kMany + 7; ++id) {
    const bool known = id > kMany - kBefore;
    ASSERT_EQ(memory.recall(id, kAfter, found) == ObservationMemory::Recall::known, known) << id;
    if (!known) continue;
    EXPECT_EQ(found.oldest_sensed_at.ns, static_cast<std::int64_t>(id));
  }
}

TEST(ObservationMemory, ForgetsAllWhenTold) {
  ObservationMemory memory;
  RememberedObservation found;
  for (std::int64_t i = 1; i <= 5; ++i) memory.remember({{i}, {i}}, 10);
  memory.forget();
  EXPECT_EQ(memory.recall(5, 10, found), ObservationMemory::Recall::forgotten);
  EXPECT_EQ(memory.recall(6, 10, found), ObservationMemory::Recall::not_yet_published);
  EXPECT_EQ(memory.remember({{6}, {6}}, 10), 6U) << "ids go on";
  EXPECT_EQ(memory.recall(6, 10, found), ObservationMemory::Recall::known);
  EXPECT_EQ(memory.recall(5, 10, found), ObservationMemory::Recall::forgotten);
}

}  // namespace
}  // namespace takt::pipeline
