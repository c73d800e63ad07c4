// Goal: a chunk says truthfully what it answers and when, and the policy's memory is dropped exactly when it must be.
// Method: a scripted policy and a clock that advances one millisecond per reading.
#include "policy_host/responder.hpp"

#include <gtest/gtest.h>

#include <array>

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
  EXPECT_EQ(resets_of(5 + 2 * Continuity::kMaxGap), 1) << "one more";
  EXPECT_EQ(policy_.last_input[7], 0.0F);
  EXPECT_EQ(resets_of(1), 1) << "backwards";
  EXPECT_EQ(resets_of(1), 1) << "repeated";
  EXPECT_EQ(resets_of(2, Mode::arming), 1) << "a new episode begins";
  EXPECT_EQ(resets_of(3, Mode::arming), 0);
  EXPECT_EQ(resets_of(4, Mode::tracking), 0);
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

}  // namespace
}  // namespace takt::policy_host
