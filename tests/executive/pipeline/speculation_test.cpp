// Goal: of what a policy answered for states that were not there yet, the executive plays the chunk whose assumption
// came true, the nearest of several, or none; it is never younger than the observation it answers, nothing outlives a
// reset, an arming or a gap, and each alternative is accounted for. Method: the rig's robot in virtual time,
// alternatives made by hand, and a random mixture of alternatives, answers, resets and late ticks against an account
// and distances of the test's own, with keyframes loaded on the way; a policy of 150 ms that speculates against the
// same one that does not.
#include "executive/pipeline/speculation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "executive/ipc/executive_segments.hpp"
#include "executive/pipeline/arrival.hpp"
#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;

constexpr std::uint32_t kJoints = 3;
constexpr float kTolerance = 0.05F, kSpeedTolerance = 0.5F;

TickConfig speculative_robot() {
  TickConfig config = testing::robot(kJoints);
  config.speculation = {kTolerance, kSpeedTolerance};
  config.freshness.max_age = milliseconds(400);
  return config;
}

// Every joint at q, and moving with dq where that is said.
struct Assumed {
  float q = 0;
  bool with_dq = false;
  float dq = 0;
};

void assume(CommandChunk& chunk, MonoTime at, const Assumed& assumed) {
  CommandHeader& header = chunk.header;
  header.assumed_at = at;
  header.assumes = static_cast<std::uint8_t>(assumed.with_dq ? 3 : 1);
  std::fill_n(chunk.values + chunk.value_count(), header.joint_count, assumed.q);
  if (assumed.with_dq)
    std::fill_n(chunk.values + chunk.value_count() + header.joint_count, header.joint_count, assumed.dq);
}

class Speculating : public ::testing::Test {
 protected:
  explicit Speculating(const TickConfig& config = speculative_robot()) : rig(config) {}
  // Tracking, at rest at q; the newest observation is a tick old, and nothing is in flight.
  void rest_at(float q) {
    rig.arm(q);
    rig.run_with_policy(1500, q);
    while (!rig.out->observation_due) rig.tick_with_policy(q);
    ASSERT_EQ(rig.mode(), Mode::tracking);
    ASSERT_NEAR(rig.drives[0].q, q, 0.01F);
    rig.tick_with_policy(q);
  }
  const CommandChunk* alternative(MonoTime at, const Assumed& assumed, float target) {
    *chunk = chunk_for(rig.config, rig.newest_observation, observed(), rig.now, ++rig.sequence, target);
    assume(*chunk, at, assumed);
    return chunk.get();
  }
  [[nodiscard]] MonoTime observed() { return rig.published_at[rig.newest_observation]; }
  Arrival publish(MonoTime at, const Assumed& assumed, float target) {
    rig.tick(alternative(at, assumed, target));
    return rig.header().arrival;
  }
  void run_until(MonoTime at) {
    while (rig.now < at) rig.tick();
  }
  [[nodiscard]] const SpeculationRecord& record() const { return rig.header().speculation; }

  Rig rig;
  std::unique_ptr<CommandChunk> chunk = std::make_unique<CommandChunk>();
};

TEST_F(Speculating, TheOneThatCameTrueIsPlayedFromItsInstantOn) {
  rest_at(0.2F);
  const std::uint64_t observation = rig.newest_observation;
  const MonoTime at = observed() + milliseconds(100);
  ASSERT_EQ(publish(at, {0.2F}, 0.4F), Arrival::accepted);
  ASSERT_EQ(publish(at, {-0.3F}, -0.4F), Arrival::accepted);
  EXPECT_EQ(record().waiting, 2);
  EXPECT_EQ(rig.header().is_speculative, 0);
  const std::uint64_t matching = rig.sequence - 1;
  run_until(at - milliseconds(1));
  EXPECT_EQ(record().waiting, 2);
  EXPECT_LT(rig.header().command_sequence, matching);
  rig.tick();
  EXPECT_EQ(record().taken_sequence, matching);
  EXPECT_EQ(record().compared, 2);
  EXPECT_EQ(record().taken, 1U);
  EXPECT_EQ(record().unmatched, 1U);
  EXPECT_EQ(record().waiting, 0);
  EXPECT_LT(record().distance, 0.2F);
  EXPECT_EQ(rig.header().command_sequence, matching);
  EXPECT_EQ(rig.header().observation_answered, observation);
  EXPECT_EQ(rig.header().is_speculative, 1);
  EXPECT_EQ(rig.header().chunk_step, 0);
  EXPECT_EQ(rig.header().age.total(), rig.now - rig.sensed_at[observation]) << "no younger than what it answers";
  rig.run(25);
  EXPECT_EQ(rig.header().chunk_step, 2);
  rig.run(60);
  EXPECT_GT(rig.out->record.joints[0].q_reference, 0.25F) << "it moves the robot";
  EXPECT_EQ(record().taken_sequence, 0U);
}

TEST_F(Speculating, NoneIsPlayedWhereNoneCameTrue) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  const std::uint64_t in_use = rig.header().command_sequence;
  publish(at, {0.2F + 1.2F * kTolerance}, 0.4F);
  publish(at, {-0.3F}, -0.4F);
  run_until(at);
  EXPECT_EQ(rig.header().command_sequence, in_use);
  EXPECT_EQ(record().unmatched, 2U);
  EXPECT_EQ(record().taken, 0U);
  EXPECT_NEAR(record().distance, 1.2F, 0.2F);
  for (int i = 0; i < 300; ++i) {
    rig.tick();
    ASSERT_LE(rig.out->record.joints[0].q_reference, 0.21F);
  }
  EXPECT_NE(rig.header().freshness, Freshness::fresh) << "the policy said nothing that can be followed";
}

TEST_F(Speculating, OfSeveralThatMatchTheNearestIsPlayed) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  publish(at, {0.2F + 0.6F * kTolerance}, 0.1F);
  publish(at, {0.2F + 0.1F * kTolerance}, 0.4F);
  publish(at, {0.2F - 0.8F * kTolerance}, 0.0F);
  const std::uint64_t nearest = rig.sequence - 1;
  run_until(at);
  EXPECT_EQ(record().taken_sequence, nearest);
  EXPECT_EQ(record().outdone, 2U);
  EXPECT_EQ(record().unmatched, 0U);
}

TEST_F(Speculating, OneJointElsewhereIsAnotherState) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  alternative(at, {0.2F}, 0.4F);
  chunk->values[chunk->value_count() + 2] = 0.3F;
  rig.tick(chunk.get());
  run_until(at);
  EXPECT_EQ(record().unmatched, 1U);
}

TEST_F(Speculating, VelocitiesAreComparedWhereTheyAreAssumed) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  publish(at, {0.2F, true, 1.1F * kSpeedTolerance}, 0.4F);
  publish(at, {0.2F, true, 0.5F * kSpeedTolerance}, 0.3F);
  const std::uint64_t slower = rig.sequence;
  run_until(at);
  EXPECT_EQ(record().taken_sequence, slower);
  EXPECT_EQ(record().unmatched, 1U);
  EXPECT_NEAR(record().distance, 0.5F, 0.1F);
}

TEST_F(Speculating, EachInstantHasItsOwn) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(50);
  publish(at, {0.2F}, 0.2F);
  publish(at + milliseconds(50), {0.2F}, 0.4F);
  const std::uint64_t later = rig.sequence;
  run_until(at);
  EXPECT_EQ(record().taken_sequence, later - 1);
  EXPECT_EQ(record().waiting, 1);
  run_until(at + milliseconds(50));
  EXPECT_EQ(record().taken_sequence, later);
}

TEST_F(Speculating, FourWaitAndTheOldestGoes) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  for (int i = 0; i < 6; ++i) publish(at, {0.2F + (i < 2 ? 0.0F : 0.4F)}, 0.4F);
  EXPECT_EQ(record().waiting, kMostAlternatives);
  EXPECT_EQ(record().dropped, 2U);
  run_until(at);
  EXPECT_EQ(record().taken, 0U) << "the two that match were the oldest";
  EXPECT_EQ(record().unmatched, 4U);
}

TEST_F(Speculating, AnAnswerToANewerObservationEndsThem) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  publish(at, {0.2F}, 0.4F);
  rig.run_with_policy(60, 0.2F);
  run_until(at);
  EXPECT_EQ(record().dropped, 1U);
  EXPECT_EQ(record().taken, 0U);
}

TEST_F(Speculating, ATickThatComesTooLateComparesNothing) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  publish(at, {0.2F}, 0.4F);
  run_until(at - milliseconds(1));
  rig.now = rig.now + milliseconds(1);  // a period is left out
  rig.tick();
  EXPECT_EQ(record().dropped, 1U);
  EXPECT_EQ(record().compared, 0);
}

TEST_F(Speculating, OneThatArrivesInTheTickOfItsInstantIsCompared) {
  rest_at(0.2F);
  const MonoTime at = rig.now + milliseconds(1);
  EXPECT_EQ(publish(at, {0.2F}, 0.4F), Arrival::accepted);
  EXPECT_EQ(record().taken_sequence, rig.sequence);
}

TEST_F(Speculating, WhatArrivesIsJudged) {
  rest_at(0.2F);
  const MonoTime at = observed() + milliseconds(100);
  const auto judged = [&](const std::function<void(CommandChunk&)>& change) {
    alternative(at, {0.2F}, 0.4F);
    change(*chunk);
    rig.tick(chunk.get());
    return rig.header().arrival;
  };
  EXPECT_EQ(judged([](CommandChunk& c) { c.header.assumes = 2; }), Arrival::wrong_shape) << "velocities alone";
  EXPECT_EQ(judged([](CommandChunk& c) { c.header.assumes = 5; }), Arrival::wrong_shape) << "a bit without a meaning";
  EXPECT_EQ(judged([](CommandChunk& c) { c.header.assumed_at = {}; }), Arrival::wrong_shape);
  EXPECT_EQ(judged([](CommandChunk& c) { c.header.assumes = 0; }), Arrival::wrong_shape) << "an instant, no state";
  EXPECT_EQ(judged([](CommandChunk& c) { c.values[c.value_count()] = NAN; }), Arrival::not_finite);
  EXPECT_EQ(judged([&](CommandChunk& c) { c.header.assumed_at = rig.now; }), Arrival::expired_assumption);
  EXPECT_EQ(judged([&](CommandChunk& c) { c.header.assumed_at = observed(); }), Arrival::expired_assumption);
  EXPECT_EQ(judged([&](CommandChunk& c) { c.header.assumed_at = observed() + milliseconds(401); }),
            Arrival::expired_assumption)
      << "it would be older than max_age there";
  EXPECT_EQ(judged([](CommandChunk& c) { c.header.assumed_at = {INT64_MAX}; }), Arrival::expired_assumption);
  EXPECT_EQ(judged([](CommandChunk& c) { c.header.assumed_at = {INT64_MIN}; }), Arrival::expired_assumption);
  EXPECT_EQ(record().waiting, 0);
  EXPECT_EQ(judged([](CommandChunk&) {}), Arrival::accepted);
  rig.config.speculation = {};
  EXPECT_EQ(judged([](CommandChunk&) {}), Arrival::wrong_shape) << "a robot that takes none";
}

TEST_F(Speculating, AFallbackPolicyMayNot) {
  rest_at(0.2F);
  rig.config.degraded = DegradedBehaviour::fallback;
  rig.config.fallback = FallbackKind::policy;
  alternative(observed() + milliseconds(100), {0.2F}, 0.4F);
  rig.input.fallback = {
      .mailbox = Arrival::accepted, .session = 1, .command = chunk.get(), .bytes = chunk->used_bytes()};
  rig.tick();
  EXPECT_EQ(rig.header().fallback.arrival, Arrival::wrong_shape);
}

TEST_F(Speculating, OfACandidateTheyAreJudgedAndNotFollowed) {
  rest_at(0.2F);
  alternative(rig.now + milliseconds(2), {0.2F}, 0.4F);
  chunk->header.policy_hash = 7;
  rig.input.candidate_policy = 7;
  rig.input.candidate = {
      .mailbox = Arrival::accepted, .session = 9, .command = chunk.get(), .bytes = chunk->used_bytes()};
  rig.tick();
  EXPECT_EQ(rig.header().candidate.arrival, Arrival::accepted);
  EXPECT_EQ(rig.header().candidate.freshness, Freshness::missing);
  EXPECT_EQ(record().waiting, 0);
}

// What was in flight before knows nothing of what the robot is there for now.
TEST_F(Speculating, NothingOutlivesAResetAnArmingASuspendOrAnotherSession) {
  const auto dropped_by = [&](const std::function<void()>& event) {
    while (!rig.out->observation_due) rig.tick_with_policy(0.2F);
    const std::uint32_t before = record().dropped;
    EXPECT_EQ(publish(observed() + milliseconds(100), {rig.drives[0].q}, 0.4F), Arrival::accepted);
    EXPECT_EQ(record().waiting, 1);
    event();
    rig.tick();
    EXPECT_EQ(record().waiting, 0);
    return record().dropped - before;
  };
  rig.run_with_policy(40, 0.2F);
  EXPECT_EQ(dropped_by([&] { rig.tick_with_policy(0.2F, OperatorRequest::arm); }), 1U);
  rig.run_with_policy(400, 0.2F);
  ASSERT_EQ(rig.mode(), Mode::tracking);
  EXPECT_EQ(dropped_by([&] {
              rig.input.slept_ms = 500;
              rig.tick();
              rig.input.slept_ms = 0;
            }),
            1U);
  rig.run_with_policy(100, 0.2F);
  rig.tick(nullptr, OperatorRequest::stop);
  rig.run_with_policy(1500, 0.2F);
  EXPECT_EQ(dropped_by([&] { rig.tick(nullptr, OperatorRequest::reset); }), 1U);
  ASSERT_EQ(rig.mode(), Mode::standby);
  EXPECT_EQ(dropped_by([&] { rig.input.policy.session = 77; }), 1U);
}

class SpeculatingWithPrefix : public Speculating {
 protected:
  static TickConfig config() {
    TickConfig config = speculative_robot();
    config.join.kind = JoinKind::prefix;
    config.join.longest_delay = milliseconds(15);
    return config;
  }
  SpeculatingWithPrefix() : Speculating(config()) {}
};

TEST_F(SpeculatingWithPrefix, WhatWasPromisedIsPlayedFirst) {
  rest_at(0.2F);
  rig.state->join.delays.forget();  // as long as the configuration allows is promised
  const MonoTime next = observed() + milliseconds(20);
  publish(next + milliseconds(3), {0.2F}, 0.4F);
  const std::uint64_t alternative = rig.sequence;
  run_until(next);
  ASSERT_TRUE(rig.out->observation_due);
  run_until(next + milliseconds(3));
  EXPECT_EQ(record().taken_sequence, alternative);
  run_until(next + milliseconds(14));
  EXPECT_NE(rig.header().command_sequence, alternative) << "not before the promise is kept";
  run_until(next + milliseconds(15));
  EXPECT_EQ(rig.header().command_sequence, alternative);
  EXPECT_EQ(rig.header().chunk_step, 1) << "its first step was meant for the assumed instant";
}

// --- a random mixture, accounted for by the test ---

struct Account {
  std::uint32_t accepted = 0;
  std::uint32_t now_in(const SpeculationRecord& record) const {
    return record.taken + record.outdone + record.unmatched + record.dropped + record.waiting;
  }
};

// The distance as the test computes it, from what the tick recorded.
float distance_of(const CommandChunk& chunk, const TickRecord& record) {
  float distance = 0;
  for (std::size_t j = 0; j < kJoints; ++j) {
    const float* const assumed = chunk.values + chunk.value_count();
    distance = std::max(distance, std::abs(assumed[j] - record.joints[j].q_estimate) / kTolerance);
    if (chunk.header.assumes == 3)
      distance = std::max(distance, std::abs(assumed[kJoints + j] - record.joints[j].dq_estimate) / kSpeedTolerance);
  }
  return distance;
}

TEST(Speculation, WhateverIsMixedNoneIsYoungerNoneIsUnaccountedForAndKeyframesCarryOn) {
  auto keyframe = std::vector<std::byte>(ipc::kMaxKeyframeBytes);
  std::uint64_t taken = 0, loaded = 0;
  for (std::uint32_t seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    const auto below = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
    TickConfig config = speculative_robot();
    if (seed % 3 == 1) config.join = {.kind = JoinKind::cross_fade, .over = milliseconds(40)};
    if (seed % 3 == 2) config.join = {.kind = JoinKind::prefix, .longest_delay = milliseconds(15)};
    Rig rig(config);
    TickStatePtr twin;  // goes on from a keyframe, on the same inputs
    auto again = std::make_unique<TickOutput>();
    std::map<std::uint64_t, CommandChunk> sent;
    auto chunk = std::make_unique<CommandChunk>();
    Account account;
    std::uint64_t answered = 0;
    for (int i = 0; i < 1500; ++i) {
      const CommandChunk* message = nullptr;
      if (rig.newest_observation != 0 && below(12) == 0) {
        const std::uint64_t id =
            rig.newest_observation - static_cast<std::uint64_t>(below(3) == 0 && rig.newest_observation > 1);
        const float target = 0.1F * static_cast<float>(below(5));
        *chunk = chunk_for(config, id, rig.published_at[id], rig.now, ++rig.sequence, target);
        if (below(4) != 0) {
          const float q = rig.drives[0].q + 0.02F * static_cast<float>(below(9) - 4);
          assume(*chunk, rig.now + milliseconds(below(60) - 5), {q, below(2) == 0, rig.drives[0].dq});
        }
        message = chunk.get();
      }
      if (below(60) == 0) rig.now = rig.now + milliseconds(below(3));
      rig.input.slept_ms = below(400) == 0 ? 10 : 0;
      if (below(500) == 0) ++rig.input.policy.session;
      const auto request = rig.mode() == Mode::standby && i > 50            ? OperatorRequest::arm
                           : below(400) == 0                                ? OperatorRequest::stop
                           : rig.mode() == Mode::damped_stop && i % 50 == 0 ? OperatorRequest::reset
                                                                            : OperatorRequest::none;
      rig.tick(message, request);
      if (twin) {
        const std::size_t bytes = message == nullptr ? 0 : message->used_bytes();
        control_tick(*twin, input_of(rig.out->record, message, bytes), config, *again);
        ASSERT_EQ(std::memcmp(&again->record, &rig.out->record, rig.out->record.used_bytes()), 0) << "seed " << seed;
      }
      if (i % 97 == 0) {
        const std::size_t bytes = save(*rig.state, keyframe);
        ASSERT_GT(bytes, 0U);
        twin = make_tick_state(config);
        ASSERT_TRUE(load(*twin, config, std::span(keyframe).first(bytes)));
        loaded += rig.header().speculation.waiting;
      }
      const TickRecordHeader& header = rig.header();
      if (message != nullptr && header.arrival == Arrival::accepted && message->header.assumes != 0) {
        ++account.accepted;
        sent[message->header.sequence] = *message;
      }
      ASSERT_EQ(account.now_in(header.speculation), account.accepted) << "seed " << seed << " tick " << i;
      ASSERT_LE(header.speculation.waiting, kMostAlternatives);
      if (header.freshness != Freshness::missing) {
        ASSERT_EQ(header.age.total(), rig.now - rig.sensed_at[header.observation_answered]);
        ASSERT_TRUE(header.player == Player::none || header.age.total() <= config.freshness.max_age);
        ASSERT_GE(header.observation_answered, answered) << "an older one replaced a newer one";
        answered = header.observation_answered;
      }
      const std::uint64_t sequence = header.speculation.taken_sequence;
      if (sequence == 0) continue;
      ++taken;
      const float distance = distance_of(sent.at(sequence), rig.out->record);
      ASSERT_LE(distance, 1.0F);
      ASSERT_EQ(distance, header.speculation.distance);
      ASSERT_LT((rig.now - sent.at(sequence).header.assumed_at).ns, config.period.ns);
    }
  }
  EXPECT_GT(taken, 100U);
  EXPECT_GT(loaded, 20U) << "keyframes carried alternatives";
}

// --- where it pays ---

// Follows a target that moves, and needs 150 ms for each answer, one at a time: of a chunk of 16 steps of 10 ms that
// begins at its observation all but the last step is over when it comes. What speculates answers for the instant at
// which the answer will be there, twice: for its own plan, and for a robot that stands where it was observed.
class SlowPolicy {
 public:
  SlowPolicy(Rig& rig, Duration inference, std::uint16_t steps, bool speculates)
      : rig_(rig), start_(rig.now), inference_(inference), steps_(steps), speculates_(speculates) {}

  [[nodiscard]] float target(MonoTime t) const {
    return 0.4F * std::sin(2.5F * static_cast<float>((t - start_).seconds()));
  }
  // What it says in this tick; null: nothing.
  const CommandChunk* answer() {
    if (!ready_.is_set() || rig_.now < ready_) return nullptr;
    const MonoTime begins = speculates_ ? seen_ + inference_ + milliseconds(4) : seen_;
    const bool on_plan = speculates_ && alternatives_++ == 0;
    const float from = on_plan ? target(begins) : observed_;
    *chunk_ = chunk_for(rig_.config, observation_, seen_, rig_.now, ++rig_.sequence, 0.0F, steps_);
    for (std::size_t step = 0; step < steps_; ++step) {
      const float path = target(begins + milliseconds(10) * static_cast<std::int64_t>(step)) +
                         (from - target(begins)) * std::exp(-0.2F * static_cast<float>(step));
      std::fill_n(&chunk_->values[value_index(chunk_->header, CommandField::q, step, 0)], kJoints, path);
    }
    if (speculates_) assume(*chunk_, begins, {from});
    if (!on_plan) ready_ = {};
    return chunk_.get();
  }
  void look() {
    if (ready_.is_set() || !rig_.out->observation_due) return;
    observation_ = rig_.newest_observation;
    seen_ = rig_.published_at[observation_];
    observed_ = rig_.out->observation.q[0];
    ready_ = seen_ + inference_;
    alternatives_ = 0;
  }

 private:
  Rig& rig_;
  MonoTime start_;
  Duration inference_;
  std::uint16_t steps_;
  bool speculates_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
  MonoTime ready_, seen_;  // of the answer being computed; unset: none is
  std::uint64_t observation_ = 0;
  float observed_ = 0;
  int alternatives_ = 0;
};

struct Followed {
  double rms = 0;    // rad
  double share = 0;  // of the ticks, in which the policy moved the robot
  SpeculationRecord speculation;
};

// 20 s, every joint pushed for 40 ms in each 1.7 s where it is.
Followed follow(const char* what, Duration inference, std::uint16_t steps, bool speculates, bool pushed) {
  TickConfig config = speculative_robot();
  config.observation_every_ticks = 10;
  config.freshness.epsilon = 0.9;  // how well it follows is measured here, not whether it may
  Rig rig(config);
  rig.arm(0.0F);
  SlowPolicy policy(rig, inference, steps, speculates);
  Followed result;
  constexpr int kTicks = 20'000;
  for (int i = 0; i < kTicks; ++i) {
    rig.tick(policy.answer());
    policy.look();
    for (std::size_t j = 0; pushed && i % 1700 < 40 && j < kJoints; ++j) rig.drives[j].dq -= 0.12F;
    const double error = static_cast<double>(rig.drives[0].q - policy.target(rig.now));
    result.rms += error * error / kTicks;
    result.share += rig.header().player == Player::policy ? 1.0 / kTicks : 0.0;
  }
  result.rms = std::sqrt(result.rms);
  const SpeculationRecord& end = result.speculation = rig.header().speculation;
  std::printf("%-40s rms %6.1f mrad, %5.1f %% of the time by the policy; %u taken, %u outdone, %u unmatched\n", what,
              result.rms * 1e3, result.share * 100, end.taken, end.outdone, end.unmatched);
  return result;
}

TEST(Speculation, PaysWhereAnInferenceTakesAsLongAsAChunk) {
  const Duration slow = milliseconds(150);
  const Followed prompt = follow("1 ms, 16 steps", milliseconds(1), 16, false, false);
  const Followed late = follow("150 ms, 16 steps", slow, 16, false, false);
  const Followed longer = follow("150 ms, 32 steps", slow, 32, false, false);
  const Followed foreseen = follow("150 ms, 16 steps, speculating", slow, 16, true, false);
  const Followed late_pushed = follow("150 ms, 16 steps, pushed", slow, 16, false, true);
  const Followed longer_pushed = follow("150 ms, 32 steps, pushed", slow, 32, false, true);
  const Followed pushed = follow("150 ms, 16 steps, pushed, speculating", slow, 16, true, true);
  EXPECT_LT(prompt.rms, longer.rms);
  EXPECT_LT(foreseen.rms, 0.2 * late.rms);
  EXPECT_LT(foreseen.rms, 1.5 * longer.rms);
  EXPECT_LT(pushed.rms, 0.5 * late_pushed.rms);
  EXPECT_GT(longer_pushed.rms, 0.0);
  EXPECT_GT(foreseen.speculation.taken, 100U);
  EXPECT_GT(pushed.speculation.unmatched, foreseen.speculation.unmatched);
}

}  // namespace
}  // namespace takt::pipeline
