// SPDX-License-Identifier: Apache-2.0
// Goal: every join is the rule that its name stands for, what promises a smooth path keeps it, what is promised to be
// played is played, and whatever joins follow one another, the reference stays inside its limits. Method: chunks on
// one grid against the published formulas; random chunks at random instants against the path of before; the whole tick
// in virtual time for promises, delays and epochs; 1e6 random joins in front of the reference.
#include "executive/pipeline/join.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <random>
#include <vector>

#include "executive/pipeline/chunk_player.hpp"
#include "executive/pipeline/messages.hpp"
#include "executive/pipeline/reference_limits.hpp"
#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;
using testing::robot;

constexpr MonoTime kStart{1'000'000'000};
constexpr Duration kStep = milliseconds(10);
constexpr JoinKind kEveryKind[] = {JoinKind::replace, JoinKind::cross_fade, JoinKind::prefix};

// One joint's path, joined as often as one likes.
struct Path {
  TickConfig config = robot(1);
  JoinState state;
  std::unique_ptr<CommandChunk> steps = std::make_unique<CommandChunk>(), next = std::make_unique<CommandChunk>();
  MonoTime begins;

  explicit Path(JoinRule rule, Interpolation interpolation = Interpolation::linear) {
    config.join = rule;
    config.interpolation = interpolation;
    config.joints[0].limits.velocity = config.joints[0].limits.q_max = 100.0F;  // clamp none of the test's values
    *next = chunk_for(config, 1, kStart, kStart, 1, 0.0F);
  }
  // The next chunk: positions, and velocities where the path is a cubic.
  void make(const std::vector<float>& q, const std::vector<float>& dq, Duration period = kStep) {
    next->header.step_count = static_cast<std::uint16_t>(q.size());
    next->header.step_period = period;
    if (config.interpolation == Interpolation::cubic)
      next->header.fields |= static_cast<std::uint8_t>(CommandField::dq);
    for (std::size_t i = 0; i < q.size(); ++i) {
      next->values[value_index(next->header, CommandField::q, i, 0)] = q[i];
      if (config.interpolation == Interpolation::cubic)
        next->values[value_index(next->header, CommandField::dq, i, 0)] = dq.empty() ? 0.0F : dq[i];
    }
  }
  void begin(const std::vector<float>& q, const std::vector<float>& dq = {}) {
    make(q, dq);
    begins = kStart;
    begin_path(state, *steps, *next);
  }
  void join(Duration chunk_begins, Duration now, const std::vector<float>& q, const std::vector<float>& dq = {},
            Duration period = kStep) {
    make(q, dq, period);
    join_path(state, *steps, begins, {*next, kStart + chunk_begins}, kStart + now, config);
    begins = kStart + chunk_begins;
  }
  [[nodiscard]] PathPoint at(Duration since) const {
    return path_at(state, {*steps, begins}, kStart + since, 0, config);
  }
  [[nodiscard]] float step(std::size_t k) const { return steps->values[k]; }
};

TEST(Join, ReplaceTakesTheNewPathAtOnce) {
  Path path({.kind = JoinKind::replace});
  path.begin({0, 0, 0, 0});
  path.join(milliseconds(10), milliseconds(20), {1, 1, 1, 1});
  EXPECT_EQ(path.at(milliseconds(20)).q, 1.0F);
}

// Goal: what a cubic path says between its steps is what is mixed, not the straight line. Method: a new chunk whose
// steps lie half way between the old one's, half way through the fade; Hermite: (q0 + q1) / 2 + h / 8 (dq0 - dq1), dq:
// 3 / 2 (q1 - q0) / h - (dq0 + dq1) / 4, and on top the share's own rate times the difference.
TEST(Join, ACubicPathIsMixedAsItIsPlayed) {
  Path path({.kind = JoinKind::cross_fade, .over = milliseconds(20)}, Interpolation::cubic);
  path.begin({0, 0, 1, 1, 1}, {0, 10, 20, 0, 0});
  path.join(milliseconds(15), milliseconds(5), {3, 3, 3}, {0, 0, 0});
  const float was = 0.5F + 0.01F / 8 * (10 - 20);
  EXPECT_FLOAT_EQ(path.step(0), 0.5F * was + 0.5F * 3);
  EXPECT_FLOAT_EQ(path.steps->values[value_index(path.steps->header, CommandField::dq, 0, 0)],
                  0.5F * (1.5F * 100 - 0.25F * 30) + 50 * (3 - was));
}

TEST(Join, CrossFadeLeadsFromOldToNew) {
  Path path({.kind = JoinKind::cross_fade, .over = milliseconds(40)});
  path.begin({0, 0, 0, 0, 0, 0, 0, 0});
  path.join(milliseconds(10), milliseconds(20), {1, 1, 1, 1, 1, 1, 1, 1});
  for (const auto& [ms, q] : {std::pair{20, 0.0F}, {30, 0.25F}, {40, 0.5F}, {45, 0.625F}, {60, 1.0F}, {70, 1.0F}})
    EXPECT_NEAR(path.at(milliseconds(ms)).q, q, 1e-6F) << ms << " ms";
}

// Steps of another period, or other fields, do not mix: the new chunk is taken, and the whole difference fades.
TEST(Join, ChunksThatDoNotMatchAreTakenAlone) {
  Path path({.kind = JoinKind::cross_fade, .over = milliseconds(20)});
  path.begin({0, 0, 0, 0});
  path.join(milliseconds(10), milliseconds(10), {1, 1, 1, 1}, {}, milliseconds(7));
  EXPECT_EQ(path.step(0), 1.0F);
  EXPECT_EQ(path.at(milliseconds(10)).q, 0.0F);
  EXPECT_FLOAT_EQ(path.at(milliseconds(20)).q, 0.5F);
}

TEST(Join, WhatIsSmoothedHasNoJump) {
  std::mt19937 random(11);
  const auto draw = [&](float width) { return std::uniform_real_distribution<float>(-width, width)(random); };
  for (const Interpolation how : {Interpolation::linear, Interpolation::cubic}) {
    Path path({.kind = JoinKind::cross_fade, .over = milliseconds(60)}, how);
    std::vector<float> q(20), dq(20);
    path.begin(q, dq);
    for (int join = 1; join < 200; ++join) {
      for (float& value : q) value = draw(1.0F);
      for (float& value : dq) value = draw(5.0F);
      const Duration begins = microseconds(join * 31'700), now = begins + microseconds(9'300);
      const PathPoint before = path.at(now);
      path.join(begins, now, q, dq);
      ASSERT_NEAR(path.at(now).q, before.q, 1e-5F) << "join " << join;
    }
  }
}

// Random chunks, late by random delays, of random periods and counts: 1e6 joins in all.
TEST(Join, TheReferenceStaysInsideItsLimits) {
  constexpr int kJoins = 1'000'000 / 3 + 1;
  constexpr double kDt = 0.001;
  std::uint64_t joins = 0;
  for (const JoinKind kind : kEveryKind) {
    std::mt19937 random(static_cast<unsigned>(kind) + 1U);
    const auto draw = [&](float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); };
    auto path = std::make_unique<Path>(JoinRule{.kind = kind, .over = milliseconds(50)});
    path->config.joints[0].limits = robot(1).joints[0].limits;
    const JointLimits& limits = path->config.joints[0].limits;
    const double q_min = static_cast<double>(limits.q_min), q_max = static_cast<double>(limits.q_max);
    const double a = static_cast<double>(limits.acceleration);
    std::array<JointTarget, 1> target{};
    target[0].speed = limits.velocity;
    ReferenceState reference;
    Duration now = milliseconds(20);
    std::vector<float> q(12, 0.0F), dq(12, 0.0F);
    path->begin(q, dq);
    for (int join = 0; join < kJoins; ++join, ++joins) {
      q.resize(4 + random() % 9);
      for (float& value : q) value = draw(-3.0F, 3.0F) * (random() % 50 == 0 ? 1.0e5F : 1.0F);
      path->join(now - milliseconds(static_cast<std::int64_t>(random() % 15)), now, q, {},
                 random() % 20 == 0 ? milliseconds(7) : kStep);
      for (unsigned tick = 0, ticks = 1 + random() % 4; tick < ticks; ++tick) {
        play(path->state, {*path->steps, path->begins}, kStart + now, path->config, target);
        const ReferenceState before = reference;
        reference = step_towards(reference, target[0].q, target[0].dq, target[0].speed, limits, kDt).next;
        const double room = reference.dq > 0 ? q_max - reference.q : reference.q - q_min;
        const double braked = std::max(std::abs(reference.dq) - a * kDt, 0.0);
        ASSERT_TRUE(std::isfinite(target[0].q) && reference.q >= q_min && reference.q <= q_max) << "join " << join;
        ASSERT_LE(std::abs(reference.dq), static_cast<double>(limits.velocity));
        ASSERT_LE(std::abs(reference.dq - before.dq), a * kDt * (1 + 1e-6));
        ASSERT_LE(stopping_distance(braked, a, kDt), room + 1e-12);
        now = now + milliseconds(1);
      }
    }
  }
  std::printf("%llu joins\n", static_cast<unsigned long long>(joins));
}

// The whole tick: an answer to the newest observation, `q` for every step, after `ticks` ticks of inference.
class Robot {
 public:
  explicit Robot(JoinRule rule) : rig_(configured(rule)) { rig_.arm(); }
  Rig& rig() { return rig_; }
  // Runs until the next observation and returns it.
  Observation next_observation() {
    do rig_.tick();
    while (!rig_.out->observation_due);
    return rig_.out->observation;
  }
  CommandChunk answer(const Observation& observation, float q) {
    return chunk_for(rig_.config, observation.id, observation.published_at, rig_.now, ++rig_.sequence, q, 8);
  }
  // Answers every observation after `delay` ticks.
  void live(int observations, int delay, float q) {
    for (int i = 0; i < observations; ++i) {
      const Observation observation = next_observation();
      rig_.run(delay - 1);
      const CommandChunk chunk = answer(observation, q);
      rig_.tick(&chunk);
    }
  }

 private:
  static TickConfig configured(JoinRule rule) {
    TickConfig config = robot(2);
    config.join = rule;
    return config;
  }
  Rig rig_;
};

// Goal: one answer that asks for what cannot be costs its own time and no more: what the robot was not led to is not
// mixed into the answers after it. Method: one joint's fifth answer is far out of range, by more and more; under every
// rule the ticks in which its target is clamped are those until the next answer.
TEST(Join, WhatIsOutOfRangeDoesNotWeighOnTheNextAnswer) {
  for (const JoinKind kind : kEveryKind) {
    for (const float bad : {8.0F, 100.0F, 9.0e5F}) {
      Robot robot({.kind = kind, .over = milliseconds(100), .longest_delay = milliseconds(19)});
      robot.live(15, 2, 0.0F);
      CommandChunk answer = robot.answer(robot.next_observation(), 0.0F);
      for (std::size_t step = 0; step < 8; ++step)
        answer.values[value_index(answer.header, CommandField::q, step, 1)] = bad;
      unsigned clamped = 0;
      const auto count = [&] {
        clamped += (robot.rig().out->record.joints[1].interventions & bit(Intervention::target_range)) != 0 ? 1U : 0U;
      };
      robot.rig().tick(&answer);
      count();
      for (int observation = 0; observation < 10; ++observation) {
        while (!robot.rig().out->observation_due) robot.rig().tick(), count();
        const CommandChunk good = robot.answer(robot.rig().out->observation, 0.0F);
        robot.rig().tick(&good);
        count();
      }
      const std::uint32_t period = robot.rig().config.observation_every_ticks;
      EXPECT_GE(clamped, 1U) << "kind " << static_cast<int>(kind) << ", " << bad;
      EXPECT_LE(clamped, period + 20) << "kind " << static_cast<int>(kind) << ", " << bad;
      EXPECT_EQ(robot.rig().mode(), Mode::tracking) << "kind " << static_cast<int>(kind) << ", " << bad;
    }
  }
}

// Goal: a handover begins where the reference is. Method: what is left to fade right after it is the reference's
// position over the path's.
TEST(Join, AHandoverBeginsAtTheReference) {
  TickConfig config = robot(2);
  config.join = {.kind = JoinKind::cross_fade, .over = milliseconds(100)};
  const auto state = std::make_unique<TickState>();
  state->seats[Seat::policy].chunk = chunk_for(config, 1, kStart, kStart, 1, 0.5F, 8);
  state->seats[Seat::policy].command.observed_at = kStart;
  state->joints[1].reference = {0.25, 1.5, -7.0};
  hand_over(*state, Seat::policy, kStart, config);
  EXPECT_FLOAT_EQ(state->seats[Seat::policy].join.remainder[1].q, -0.25F);
}

constexpr JoinRule kPrefix{.kind = JoinKind::prefix, .longest_delay = milliseconds(19)};

TEST(Prefix, PromisesAsManyStepsAsAnAnswerTakesAndPlaysThem) {
  Robot robot(kPrefix);
  robot.live(15, 6, 0.0F);
  const Observation observation = robot.next_observation();
  EXPECT_EQ(observation.command_sequence, robot.rig().sequence);
  EXPECT_EQ(observation.committed_from, 2U) << "20 ms after its observation, steps of 10 ms";
  EXPECT_EQ(observation.committed_count, 1U) << "6 ms: within one step";
  const std::uint64_t old = robot.rig().sequence;
  CommandChunk early = robot.answer(observation, 0.3F);
  robot.rig().tick(&early);
  EXPECT_EQ(robot.rig().header().seats[Seat::policy].arrival, Arrival::accepted);
  for (int tick = 2; tick < 6; ++tick) {
    EXPECT_EQ(robot.rig().header().seats[Seat::policy].command_sequence, old) << "the promise is kept";
    robot.rig().tick();
  }
  robot.rig().tick();
  EXPECT_EQ(robot.rig().header().seats[Seat::policy].command_sequence, early.header.sequence);
  EXPECT_EQ(robot.rig().header().age.hold, Duration{}) << "first use";
}

// An answer that takes exactly to the end of a step promises that step and not the one after.
TEST(Prefix, APromiseThatEndsWithAStepNamesNoFurtherOne) {
  Robot robot(kPrefix);
  robot.live(15, 10, 0.0F);
  const Observation observation = robot.next_observation();
  EXPECT_EQ(observation.committed_from, 2U);
  EXPECT_EQ(observation.committed_count, 1U);
}

TEST(Prefix, AnAnswerLaterThanThePromiseIsTakenAtOnce) {
  Robot robot(kPrefix);
  robot.live(15, 6, 0.0F);
  const Observation observation = robot.next_observation();
  robot.rig().run(9);
  const CommandChunk late = robot.answer(observation, 0.3F);
  robot.rig().tick(&late);
  EXPECT_EQ(robot.rig().header().seats[Seat::policy].command_sequence, late.header.sequence);
}

TEST(Prefix, AnOlderAnswerNeverReplacesOneThatWaits) {
  Robot robot(kPrefix);
  robot.live(15, 6, 0.0F);
  const Observation older = robot.next_observation();
  const Observation newer = robot.next_observation();
  const CommandChunk early = robot.answer(newer, 0.1F);
  robot.rig().tick(&early);
  const CommandChunk late = robot.answer(older, 0.5F);
  robot.rig().tick(&late);
  EXPECT_EQ(robot.rig().header().seats[Seat::policy].arrival, Arrival::overtaken);
  robot.rig().run(6);
  EXPECT_EQ(robot.rig().header().seats[Seat::policy].command_sequence, early.header.sequence);
}

TEST(Prefix, WhatWaitsTakesOverWhenThePathEndsEarlier) {
  Robot robot({.kind = JoinKind::prefix, .longest_delay = milliseconds(19)});
  robot.live(15, 18, 0.0F);
  const Observation first = robot.next_observation();
  CommandChunk brief = robot.answer(first, 0.0F);
  brief.header.step_count = 3;  // spent 30 ms after its observation
  robot.rig().run(17);
  robot.rig().tick(&brief);
  const Observation second = robot.next_observation();
  CommandChunk next = robot.answer(second, 0.1F);
  robot.rig().tick(&next);
  for (int tick = 0; tick < 19 && robot.rig().header().seats[Seat::policy].command_sequence != next.header.sequence;
       ++tick) {
    robot.rig().tick();
    EXPECT_EQ(robot.rig().header().seats[Seat::policy].freshness, Freshness::fresh);
  }
  EXPECT_EQ(robot.rig().header().seats[Seat::policy].command_sequence, next.header.sequence);
}

TEST(Prefix, NothingIsPromisedWhereNothingIsPlayedOrTheJoinIsAnother) {
  Rig standing(robot(2));
  standing.run(25);
  EXPECT_EQ(standing.out->observation.committed_count, 0U);
  Robot other({.kind = JoinKind::replace});
  other.live(5, 6, 0.0F);
  EXPECT_EQ(other.next_observation().committed_count, 0U);
}

TEST(DelayMemory, IsTheLongestOfTheLastTenThatHaveNotExpiredAndNotOfTheFirst) {
  DelayMemory memory;
  memory.note(kStart, milliseconds(900));
  EXPECT_EQ(memory.longest(kStart), Duration{}) << "the first inference is no measure";
  memory.note(kStart, milliseconds(30));
  for (int i = 1; i < 10; ++i) memory.note(kStart + milliseconds(i), milliseconds(10));
  EXPECT_EQ(memory.longest(kStart + milliseconds(20)), milliseconds(30));
  memory.note(kStart + milliseconds(20), milliseconds(12));
  EXPECT_EQ(memory.longest(kStart + milliseconds(20)), milliseconds(12)) << "ten later the spike is forgotten";
  EXPECT_EQ(memory.longest(kStart + seconds(6)), Duration{});
}

// Goal: what was in flight before an arming or a reset plays no part after it, and is counted.
// Goal: the command in use ends with the reset or the de-energising, however young it is. Method: a policy that speaks
// until that very tick and not after it; the robot is armed again at once.
TEST(Epoch, NoCommandOfBeforeAResetMovesTheRobotAfterIt) {
  for (const OperatorRequest leaves : {OperatorRequest::reset, OperatorRequest::deenergise}) {
    Rig rig(robot(1));
    rig.arm(0.3F);
    rig.run_with_policy(500, 0.3F);
    rig.tick_with_policy(0.3F, OperatorRequest::stop);
    rig.run_with_policy(1500, 0.3F);
    while (!rig.out->observation_due) rig.tick_with_policy(0.3F);
    rig.tick_with_policy(1.2F, leaves);
    ASSERT_EQ(rig.mode(), Mode::standby);
    EXPECT_EQ(rig.header().seats[Seat::policy].freshness, Freshness::missing);
    for (int i = 0; i < 80; ++i) {
      rig.tick(nullptr, OperatorRequest::arm);
      ASSERT_EQ(rig.mode(), Mode::standby) << "nothing is there to follow, " << i << " ms after";
      ASSERT_EQ(rig.header().seats[Seat::policy].freshness, Freshness::missing);
    }
    rig.arm(0.3F);
    EXPECT_EQ(rig.mode(), Mode::tracking);
  }
}

TEST(Epoch, AnswersToObservationsOfBeforeAnArmingOrAResetAreRefused) {
  Rig rig(robot(2));
  rig.run_with_policy(60, 0.0F);
  const std::uint64_t before = rig.newest_observation;
  rig.tick_with_policy(0.0F, OperatorRequest::arm);
  ASSERT_EQ(rig.mode(), Mode::arming);
  const std::uint32_t refused = rig.header().refused_commands;
  CommandChunk chunk = chunk_for(rig.config, before, rig.published_at[before], rig.now, ++rig.sequence, 0.5F);
  rig.tick(&chunk);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::expired_observation);
  EXPECT_EQ(rig.header().refused_commands, refused + 1);
  rig.run_with_policy(60, 0.0F);
  ASSERT_EQ(rig.mode(), Mode::tracking) << "the command in use carries the arming";

  rig.tick(nullptr, OperatorRequest::stop);
  rig.run_with_policy(300, 0.0F);
  const std::uint64_t stopped = rig.newest_observation;
  rig.tick(nullptr, OperatorRequest::reset);
  ASSERT_EQ(rig.mode(), Mode::standby);
  chunk = chunk_for(rig.config, stopped, rig.published_at[stopped], rig.now, ++rig.sequence, 0.5F);
  rig.tick(&chunk);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::expired_observation);
}

}  // namespace
}  // namespace takt::pipeline
