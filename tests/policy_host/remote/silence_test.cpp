// SPDX-License-Identifier: Apache-2.0
// Goal: the part that failed is named when no answer of a policy server is played: its machine or the network, its
// policy, its sensors' way, its files, a namesake, or answers that were refused. Method: what servers say, by hand.
#include "policy_host/remote/silence.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace takt::policy_host::remote {
namespace {

constexpr MonoTime kNow{100'000'000'000};
constexpr Duration kMaxAge = milliseconds(200);
constexpr PeerId kFar{{1}}, kNear{{2}};
constexpr std::uint64_t kEpoch = 5;

ServerState sound(const PeerId& sender = kFar, const std::string& name = "far") {
  return {.sender = sender,
          .name = name,
          .address = {},
          .problem = {},
          .has_policy = true,
          .epoch = kEpoch,
          .shown_age = milliseconds(20),
          .heard_at = kNow - milliseconds(50)};
}

TEST(Silence, NamesThePartThatFailed) {
  struct Case {
    std::function<void(ServerState&)> state;
    const char* said;
  };
  const std::vector<Case> cases{
      {[](ServerState&) {}, "policy server far hears this robot, and its policy does not answer"},
      {[](ServerState& s) { s.has_policy = false; }, "policy server far has no policy"},
      {[](ServerState& s) { s.heard_at = kNow - kMaxAge - milliseconds(1); }, "policy server far is not heard"},
      {[](ServerState& s) { s.shown_age = kMaxAge + milliseconds(1); }, "policy server far does not hear this robot"},
      {[](ServerState& s) { s.epoch = 0, s.shown_age = Duration{-1}; }, "policy server far does not hear this robot"},
      {[](ServerState& s) { s.epoch = 6; }, "policy server far answers another robot of this name"},
      {[](ServerState& s) { s.problem = "ws://gpu:8000 closed the connection"; },
       "policy server far hears this robot, and its policy says: ws://gpu:8000 closed the connection"},
      {[](ServerState& s) { s.lacks_samples = true, s.shown_age = kMaxAge * 2; },
       "policy server far does not get the sensors' samples"},
      {[](ServerState& s) { s.lacks_samples = true; }, "policy server far hears this robot, and its policy does not"},
      {[](ServerState& s) { s.has_other_files = true; }, "policy server far has another robot file or policy.file"},
  };
  for (const Case& one : cases) {
    Silence silence;
    ServerState state = sound();
    one.state(state);
    silence.heard(state);
    const std::string said = silence.reason(kFar, kEpoch, 1, kMaxAge, kNow);
    EXPECT_EQ(said.find(one.said), 0U) << one.said << ": " << said;
  }
}

// The machine that answers though its server does not is no failure of the network; and the other way round.
TEST(Silence, TellsAServerThatEndedFromANetworkThatFailed) {
  Silence silence;
  ServerState lost = sound();
  lost.address = "10.0.0.2";
  lost.heard_at = kNow - seconds(2);
  silence.heard(lost);
  EXPECT_EQ(silence.address_of(kFar), "10.0.0.2");
  EXPECT_EQ(silence.address_of(kNear), "");
  const auto said = [&](Machine machine) { return silence.reason(kFar, kEpoch, 1, kMaxAge, kNow, machine); };
  EXPECT_NE(said(Machine::answers).find("takt-policy-server ended there, or hangs"), std::string::npos);
  EXPECT_NE(said(Machine::silent).find("the network to it failed, or the machine itself"), std::string::npos);
  EXPECT_NE(said(Machine::unknown).find("its machine, its takt-policy-server or the network"), std::string::npos);
  silence.heard(sound(kNear, "near"));
  EXPECT_EQ(said(Machine::silent).find("policy server near hears"), 0U)
      << "the leader's machine says nothing of others";
}

TEST(Silence, SaysWhyAnswersWereRefusedSinceTheLastThatWasPlayed) {
  Silence silence;
  silence.heard(sound());
  silence.refused(AnswerVerdict::overtaken);
  silence.refused(AnswerVerdict::not_finite);
  silence.refused(AnswerVerdict::not_finite);
  EXPECT_NE(silence.reason(kFar, kEpoch, 1, kMaxAge, kNow).find(name(AnswerVerdict::not_finite)), std::string::npos);
  silence.played();
  EXPECT_NE(silence.reason(kFar, kEpoch, 1, kMaxAge, kNow).find("its policy does not answer"), std::string::npos);
}

TEST(Silence, WithoutAnyServerItSaysWhetherOneIsThere) {
  const Silence silence;
  EXPECT_EQ(silence.reason({}, kEpoch, 0, kMaxAge, kNow).find("no policy server is in the DDS domain"), 0U);
  EXPECT_EQ(silence.reason({}, kEpoch, 1, kMaxAge, kNow).find("a policy server is in the DDS domain"), 0U);
}

TEST(Silence, TellsOfAServerThatIsHeardBeforeALeaderThatIsNot) {
  Silence silence;
  ServerState lost = sound();
  lost.heard_at = kNow - seconds(2);
  silence.heard(lost);
  ServerState near = sound(kNear, "near");
  near.has_policy = false;
  silence.heard(near);
  EXPECT_EQ(silence.reason(kFar, kEpoch, 1, kMaxAge, kNow).find("policy server near has no policy"), 0U);
}

TEST(Silence, StrangersDoNotPushAServerOut) {
  Silence silence;
  silence.heard(sound());
  for (std::uint8_t i = 0; i < 100; ++i) {
    ServerState stranger = sound({{9, i}}, "stranger");
    stranger.heard_at = kNow - milliseconds(60);
    silence.heard(stranger);
  }
  EXPECT_EQ(silence.reason(kFar, kEpoch, 9, kMaxAge, kNow).find("policy server far "), 0U);
}

// What is lost with the newest answer is missed before its absence is explained.
TEST(Silence, ExplainsNothingBeforeItCanKnow) {
  for (const Duration max_age : {milliseconds(20), milliseconds(150), seconds(2)}) {
    const Duration lost = std::max(Silence::heard_for(max_age), max_age);
    EXPECT_GE(Silence::patience(max_age), lost + Silence::status_period(max_age));
  }
}

}  // namespace
}  // namespace takt::policy_host::remote
