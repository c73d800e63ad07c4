// SPDX-License-Identifier: Apache-2.0
// Goal: a chunk says truthfully what it answers and when, and the policy's memory is dropped exactly when it must be.
// Method: a scripted policy and a clock that advances one millisecond per reading.
#include "policy_host/responder.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "tests/policy_host/scripted_policy.hpp"
#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

MonoTime g_now;
MonoTime ticking_clock() {
  return g_now = g_now + milliseconds(1);
}

class ResponderTest : public testing::Test {
 protected:
  ResponderTest() : robot_(small_robot()), policy_(10, 12), responder_(robot_, 0xABCD, policy_) {
    g_now = MonoTime{} + seconds(5);
  }
  const CommandHeader& answer(std::uint64_t id, Mode mode = Mode::tracking) {
    auto observation = small_observation(id);
    observation.mode = static_cast<std::uint8_t>(mode);
    const auto sample = small_sample(4, 1, 2);
    return responder_.answer(observation, std::span(&sample, 1), MonoTime{} + seconds(4), ticking_clock).header;
  }
  // The resets that answering this observation brings about.
  int resets_of(std::uint64_t id, Mode mode = Mode::tracking) {
    const int before = policy_.resets;
    answer(id, mode);
    return policy_.resets - before;
  }

  config::RobotConfig robot_;
  ScriptedPolicy policy_;
  Responder responder_;
};

TEST_F(ResponderTest, StampsRunForwardsAndNameTheirSources) {
  responder_.start_session();
  const CommandHeader& header = answer(1);
  EXPECT_EQ(header.observation_id, 1U);
  EXPECT_EQ(header.policy_hash, 0xABCDU);
  EXPECT_EQ(header.outside_sensed_at, MonoTime{} + milliseconds(120)) << "the sensor sample's stamp";
  EXPECT_EQ(header.dequeued_at, MonoTime{} + seconds(4));
  EXPECT_EQ(header.infer_started_at, MonoTime{} + milliseconds(5001));
  EXPECT_EQ(header.infer_ended_at, MonoTime{} + milliseconds(5002));
  EXPECT_EQ(header.published_at, MonoTime{} + milliseconds(5003));
}

TEST_F(ResponderTest, OutsideStampIsTheOldestOfTheSensorsInUse) {
  robot_.sensors.push_back({.name = "idle", .values = 1, .timeout = milliseconds(1)});
  robot_.sensors.push_back({.name = "ear", .values = 1, .timeout = milliseconds(200)});
  auto ear = term(config::TermKind::sensor, 1);
  ear.sensor = "ear";
  robot_.policy->observation.push_back(ear);
  ScriptedPolicy policy(11, 12);
  Responder responder(robot_, 0, policy);
  const std::array samples{small_sample(4, 1, 2), small_sample(1, 0, 0), small_sample(3, 9, 9)};
  EXPECT_EQ(responder.answer(small_observation(1), samples, g_now, ticking_clock).header.outside_sensed_at,
            MonoTime{} + milliseconds(90))
      << "ear at 90 ms is older than eye at 120 ms; idle at 30 ms feeds nothing";
}

TEST_F(ResponderTest, SequencesStartAtOneInEverySession) {
  responder_.start_session();
  EXPECT_EQ(answer(1).sequence, 1U);
  EXPECT_EQ(answer(2).sequence, 2U);
  responder_.start_session();
  EXPECT_EQ(answer(900).sequence, 1U);
}

TEST_F(ResponderTest, CountsSkippedObservations) {
  responder_.start_session();
  EXPECT_EQ(answer(10).dropped_observations, 0U) << "what came before the session was not ours to answer";
  EXPECT_EQ(answer(11).dropped_observations, 0U);
  EXPECT_EQ(answer(14).dropped_observations, 2U);
  EXPECT_EQ(answer(3).dropped_observations, 0U) << "ids ran backwards: another executive";
}

TEST_F(ResponderTest, LastActionIsTheStepThatIsDue) {
  responder_.start_session();
  answer(1);
  EXPECT_EQ(policy_.last_input[7], 0.0F) << "no action yet";
  answer(2);  // 20 ms later: step 2 of the first chunk
  EXPECT_FLOAT_EQ(policy_.last_input[7], 1.06F);
  EXPECT_FLOAT_EQ(policy_.last_input[9], 1.08F);
}

TEST_F(ResponderTest, ForgetsOnLongGapsBackwardIdsAndArming) {
  responder_.start_session();
  answer(1);
  EXPECT_EQ(resets_of(2), 0);
  EXPECT_EQ(resets_of(3 + Continuity::kMaxGap), 0) << "a gap that history survives";
  EXPECT_EQ(policy_.last_input[7], 2.09F) << "the spent chunk's last step";
  EXPECT_EQ(resets_of(4 + Continuity::kMaxGap), 0);
  EXPECT_EQ(resets_of(6 + 2 * Continuity::kMaxGap), 1) << "one more";
  EXPECT_EQ(policy_.last_input[7], 0.0F);
  EXPECT_EQ(resets_of(1), 1) << "backwards";
  EXPECT_EQ(resets_of(1), 1) << "repeated";
  EXPECT_EQ(resets_of(2, Mode::arming), 1) << "a new episode begins";
  EXPECT_EQ(resets_of(3, Mode::arming), 0);
  EXPECT_EQ(resets_of(4, Mode::tracking), 0);
}

// Goal: a policy whose answers take many periods keeps its history from answer to answer, and loses it to an absence.
// Method: an answer per ten observations, a little more and a little less; then one after thirty.
TEST_F(ResponderTest, RemembersHoweverManyPeriodsEachAnswerTakes) {
  responder_.start_session();
  answer(1);
  EXPECT_EQ(resets_of(11), 1) << "more than it was used to";
  for (const std::uint64_t id : {21U, 33U, 42U, 53U}) EXPECT_EQ(resets_of(id), 0) << id;
  EXPECT_EQ(resets_of(83), 1) << "an absence";
  EXPECT_EQ(resets_of(84), 0);
  EXPECT_EQ(resets_of(94), 1) << "used to each of them";
}

TEST_F(ResponderTest, BrokenOutputIsPublishedAsItIsButNotRemembered) {
  responder_.start_session();
  policy_.broken = true;
  answer(1);
  policy_.broken = false;
  answer(2);
  EXPECT_EQ(policy_.last_input[7], 0.0F);
}

// Goal: of several requests in flight an older one never replaces a newer one, and none outlives its session. Method:
// three observations asked of, taken in another order; then one asked of before a session ends.
TEST_F(ResponderTest, AnOvertakenAnswerAndOneOfAnotherSessionAreNone) {
  responder_.start_session();
  const auto sample = small_sample(4, 1, 2);
  std::array<Request, 4> requests;
  for (std::uint64_t id = 1; id <= 3; ++id)
    responder_.ask(small_observation(id), std::span(&sample, 1), g_now, requests[id - 1]);
  for (Request& request : std::span(requests).first(3)) Responder::infer(policy_, request, ticking_clock);
  for (const std::size_t taken : {0U, 2U}) {
    const CommandChunk* const chunk = responder_.take(requests[taken], ticking_clock);
    ASSERT_NE(chunk, nullptr);
    EXPECT_EQ(chunk->header.observation_id, taken + 1);
    EXPECT_EQ(chunk->header.sequence, taken + 1);
    EXPECT_EQ(chunk->header.infer_started_at, requests[taken].infer_started_at) << "its own stamps";
    EXPECT_EQ(responder_.inference().number, taken == 0 ? 1U : 2U) << "answers, not requests";
  }
  EXPECT_EQ(responder_.take(requests[1], ticking_clock), nullptr) << "overtaken";
  responder_.ask(small_observation(4), std::span(&sample, 1), g_now, requests[3]);
  Responder::infer(policy_, requests[3], ticking_clock);
  responder_.start_session();
  EXPECT_EQ(responder_.take(requests[3], ticking_clock), nullptr) << "of the session before";
}

TEST_F(ResponderTest, WhatWasInFlightWhenThePastWasForgottenIsNotRemembered) {
  responder_.start_session();
  const auto sample = small_sample(4, 1, 2);
  Request before, after;
  responder_.ask(small_observation(1), std::span(&sample, 1), g_now, before);
  Responder::infer(policy_, before, ticking_clock);
  responder_.ask(small_observation(100), std::span(&sample, 1), g_now, after);
  EXPECT_TRUE(after.after_reset);
  EXPECT_NE(responder_.take(before, ticking_clock), nullptr) << "the executive judges its age";
  answer(101);
  EXPECT_EQ(policy_.last_input[7], 0.0F) << "no action yet";
}

// A sampler's policy as the responder sees it: it may say NaN from some step on.
class SamplerResponderTest : public testing::Test {
 protected:
  SamplerResponderTest() : robot_(small_robot()) {
    robot_.policy->sampler.emplace();
    robot_.policy->sampler->prefix = config::PrefixUse::trained;
  }
  // Sends an observation, `inference` after its publication the answer is there. Null: it was dropped.
  const CommandChunk* answer(Responder& responder, Policy& policy, std::uint64_t id, std::uint64_t playing,
                             std::uint32_t promised, Duration inference) {
    Observation observation = small_observation(id);
    observation.command_sequence = playing;
    observation.committed_count = promised;
    g_now = observation.published_at + inference - milliseconds(2);  // two readings: started, ended
    const auto sample = small_sample(4, 1, 2);
    responder.ask(observation, std::span(&sample, 1), observation.published_at, request_);
    Responder::infer(policy, request_, ticking_clock);
    return responder.take(request_, ticking_clock);
  }
  config::RobotConfig robot_;
  Request request_;
};

TEST_F(SamplerResponderTest, TheInputEndsWithThePathThatIsBeingPlayed) {
  ScriptedPolicy policy(10 + 5 + 12, 12);
  Responder responder(robot_, 0, policy);
  responder.start_session();
  ASSERT_NE(answer(responder, policy, 1, 0, 0, milliseconds(3)), nullptr);
  ASSERT_NE(answer(responder, policy, 2, 1, 1, milliseconds(3)), nullptr);
  const std::vector<float> context(policy.last_input.begin() + 10, policy.last_input.end());
  ASSERT_EQ(context.size(), 17U);
  EXPECT_EQ(std::vector(context.begin(), context.begin() + 5), (std::vector<float>{2, 0, 0, 1, 2}));
  EXPECT_FLOAT_EQ(context[5], 1.06F) << "the first answer's third step";
  EXPECT_FLOAT_EQ(context[16], 1.11F) << "and the end of its fourth, which stands on";
}

TEST_F(SamplerResponderTest, WhatContinuesAPrefixThatEndedBeforeIsDroppedButNotTwiceInARow) {
  ScriptedPolicy policy(10 + 5 + 12, 12);
  Responder responder(robot_, 0, policy);
  responder.start_session();
  EXPECT_NE(answer(responder, policy, 1, 0, 0, milliseconds(50)), nullptr) << "nothing was promised";
  EXPECT_NE(answer(responder, policy, 2, 1, 1, milliseconds(20)), nullptr) << "a step late, the path was as shown";
  EXPECT_EQ(answer(responder, policy, 3, 2, 1, milliseconds(21)), nullptr) << "later, it was another one";
  EXPECT_NE(answer(responder, policy, 3, 2, 1, milliseconds(21)), nullptr) << "the executive has to learn it";
  EXPECT_EQ(answer(responder, policy, 4, 4, 1, milliseconds(21)), nullptr);
  EXPECT_NE(answer(responder, policy, 4, 4, 1, milliseconds(19)), nullptr) << "in time again";
}

// Who chooses the nearest to the path of before, while the newest answer is on its way, follows two paths in turn.
TEST_F(SamplerResponderTest, OnlyWhoDrawsOnThePathWaitsForItsAnswer) {
  for (const auto prefix : {config::PrefixUse::none, config::PrefixUse::guided, config::PrefixUse::trained}) {
    robot_.policy->sampler->prefix = prefix;
    ScriptedPolicy policy(10 + 5 + 12, 12);
    Responder responder(robot_, 0, policy);
    responder.start_session();
    answer(responder, policy, 1, 0, 0, milliseconds(3));
    EXPECT_EQ(responder.awaits(small_observation(2)), prefix != config::PrefixUse::none);
  }
  robot_.policy->sampler->prefix = config::PrefixUse::none;
  robot_.policy->sampler->samples = 2;
  for (const auto choice : {config::SampleChoice::agreed, config::SampleChoice::coherent}) {
    robot_.policy->sampler->choice = choice;
    ScriptedPolicy policy(10 + 5 + 12, 12);
    Responder responder(robot_, 0, policy);
    responder.start_session();
    answer(responder, policy, 1, 0, 0, milliseconds(3));
    EXPECT_EQ(responder.awaits(small_observation(2)), choice == config::SampleChoice::coherent);
  }
}

class AgreeingPolicy final : public Policy {
 public:
  [[nodiscard]] std::size_t input_size() const override { return 10 + 5 + 12; }
  [[nodiscard]] std::size_t output_size() const override { return 12; }
  void reset() override {}
  void infer(std::span<const float> /*input*/, std::span<float> output) override {
    for (std::size_t i = 0; i < output.size(); ++i)
      output[i] = i < 3 * agreed ? static_cast<float>(i) : std::numeric_limits<float>::quiet_NaN();
  }
  std::size_t agreed = 2;
};

TEST_F(SamplerResponderTest, AChunkHasTheStepsThatWereAgreedOn) {
  robot_.policy->sampler->prefix = config::PrefixUse::none;
  robot_.policy->sampler->choice = config::SampleChoice::agreed;
  AgreeingPolicy policy;
  Responder responder(robot_, 0, policy);
  responder.start_session();
  const CommandChunk* const chunk = answer(responder, policy, 1, 0, 0, milliseconds(3));
  ASSERT_NE(chunk, nullptr);
  EXPECT_EQ(chunk->header.step_count, 2U);
  EXPECT_FLOAT_EQ(chunk->values[value_index(chunk->header, CommandField::q, 1, 2)], 3.0F + 5.0F);
  answer(responder, policy, 2, 1, 0, milliseconds(3));
  EXPECT_EQ(std::vector(request_.input.begin() + 7, request_.input.begin() + 10), (std::vector<float>{3, 4, 5}))
      << "as the last action the last step stands on: what was not agreed on is NaN";
  EXPECT_FALSE(request_.after_reset);
  policy.agreed = 0;
  EXPECT_EQ(answer(responder, policy, 3, 2, 0, milliseconds(3))->header.step_count, 1U)
      << "nothing finite at all is for the executive to refuse";
}

}  // namespace
}  // namespace takt::policy_host
