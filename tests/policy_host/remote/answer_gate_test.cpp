// SPDX-License-Identifier: Apache-2.0
// Goal: what comes from another machine moves a robot only if it answers an observation of this session, with this
// robot file, policy and shape, once, in order and in time; and its stamps can make a command older, never younger; of
// several servers one leads, and a silent one loses the lead within a bound. Method: answers by hand, time by hand.
#include "policy_host/remote/answer_gate.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "policy_host/remote/server_choice.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr MonoTime kNow{100'000'000'000};
constexpr GateFacts kFacts{.config_hash = 1,
                           .policy_hash = 2,
                           .step_count = 4,
                           .joint_count = 3,
                           .step_period = milliseconds(10),
                           .max_age = milliseconds(150)};

constexpr PeerId process(std::uint8_t number) {
  return {{number}};
}

Answer good(std::uint64_t observation, std::uint64_t sequence) {
  return {.sender = process(7),
          .server = 7,
          .epoch = 5,
          .config_hash = 1,
          .policy_hash = 2,
          .observation_id = observation,
          .sequence = sequence,
          .queued = milliseconds(1),
          .inferred = milliseconds(20),
          .older = {},
          .dropped = 0,
          .step_period = milliseconds(10),
          .step_count = 4,
          .joint_count = 3,
          .fields = 1,
          .value_count = 12};
}

// A session in which observations 1 to 10 were shown, 10 ms apart, the tenth just now.
AnswerGate begun() {
  AnswerGate gate(kFacts);
  gate.begin(5);
  for (std::uint64_t id = 1; id <= 10; ++id) {
    const MonoTime at = kNow - milliseconds(10 * static_cast<std::int64_t>(10 - id));
    gate.show({id, at, at + milliseconds(1), at - milliseconds(4), at - milliseconds(2)});
  }
  return gate;
}

TEST(AnswerGate, RefusesWhatIsNotAnAnswerToThisRobot) {
  struct Case {
    const char* when;
    std::function<void(Answer&)> wrong;
    AnswerVerdict verdict;
  };
  const std::vector<Case> cases{
      {"another robot file", [](Answer& a) { a.config_hash = 9; }, AnswerVerdict::other_robot},
      {"another policy", [](Answer& a) { a.policy_hash = 9; }, AnswerVerdict::other_robot},
      {"no server", [](Answer& a) { a.server = 0; }, AnswerVerdict::other_robot},
      {"an earlier session", [](Answer& a) { a.epoch = 4; }, AnswerVerdict::other_epoch},
      {"the future", [](Answer& a) { a.observation_id = 11; }, AnswerVerdict::unknown},
      {"a number that falls together", [](Answer& a) { a.observation_id = 10 + 1024; }, AnswerVerdict::unknown},
      {"no observation", [](Answer& a) { a.observation_id = 0; }, AnswerVerdict::unknown},
      {"another width", [](Answer& a) { a.joint_count = 2, a.value_count = 8; }, AnswerVerdict::wrong_shape},
      {"fewer values than it says", [](Answer& a) { a.value_count = 11; }, AnswerVerdict::wrong_shape},
      {"more values than it says", [](Answer& a) { a.value_count = 40'960; }, AnswerVerdict::wrong_shape},
      {"a shorter chunk", [](Answer& a) { a.step_count = 3, a.value_count = 9; }, AnswerVerdict::wrong_shape},
      {"another pace", [](Answer& a) { a.step_period = milliseconds(1); }, AnswerVerdict::wrong_shape},
      {"no positions", [](Answer& a) { a.fields = 2; }, AnswerVerdict::wrong_shape},
      {"fields that do not exist", [](Answer& a) { a.fields = 0x81; }, AnswerVerdict::wrong_shape},
  };
  for (const Case& one : cases) {
    AnswerGate gate = begun();
    Answer answer = good(10, 1);
    one.wrong(answer);
    EXPECT_EQ(gate.judge(answer, true, kNow), one.verdict) << one.when;
  }
  AnswerGate gate = begun();
  EXPECT_EQ(gate.judge(good(10, 1), false, kNow), AnswerVerdict::not_finite);
  EXPECT_EQ(gate.judge(good(10, 1), true, kNow), AnswerVerdict::usable);
}

TEST(AnswerGate, TakesEachAnswerOnceAndNoneBehindANewerOneOrTooLate) {
  AnswerGate gate = begun();
  ASSERT_EQ(gate.judge(good(9, 3), true, kNow), AnswerVerdict::usable);
  gate.play(good(9, 3), kNow);
  EXPECT_EQ(gate.judge(good(9, 3), true, kNow), AnswerVerdict::repeated) << "a frame that came twice";
  EXPECT_EQ(gate.judge(good(10, 2), true, kNow), AnswerVerdict::repeated) << "one that was overtaken by its next";
  EXPECT_EQ(gate.judge(good(8, 4), true, kNow), AnswerVerdict::overtaken);
  Answer other = good(8, 1);
  other.sender = process(8);
  other.server = 8;
  EXPECT_EQ(gate.judge(other, true, kNow), AnswerVerdict::overtaken) << "another server's, too";
  EXPECT_EQ(gate.judge(good(10, 5), true, kNow + milliseconds(151)), AnswerVerdict::overtaken) << "older than max_age";
  EXPECT_EQ(gate.judge(good(10, 6), true, kNow + milliseconds(150)), AnswerVerdict::usable);
}

// Goal: what another process sends under a server's number costs that server nothing. Method: the largest number there
// is, before and after the server was heard.
TEST(AnswerGate, AStrangerMutesNoServerByItsNumber) {
  for (const bool comes_first : {false, true}) {
    AnswerGate gate = begun();
    Answer strange = good(9, UINT64_MAX);
    strange.sender = process(99);
    if (!comes_first) {
      EXPECT_EQ(gate.judge(good(9, 3), true, kNow), AnswerVerdict::usable);
    }
    EXPECT_EQ(gate.judge(strange, true, kNow), comes_first ? AnswerVerdict::usable : AnswerVerdict::of_another);
    const MonoTime later = comes_first ? kNow + kFacts.max_age + Duration{1} : kNow;
    gate.show({11, later, later, later, later});
    EXPECT_EQ(gate.judge(good(11, 4), true, later), AnswerVerdict::usable)
        << "no longer than max_age, had it been first";
    strange.observation_id = 11;
    EXPECT_NE(gate.judge(strange, true, later), AnswerVerdict::usable);
  }
}

TEST(AnswerGate, SixteenStrangersDoNotMakeItForgetAServer) {
  AnswerGate gate = begun();
  ASSERT_EQ(gate.judge(good(9, 3), true, kNow), AnswerVerdict::usable);
  gate.play(good(9, 3), kNow);
  for (std::uint8_t stranger = 0; stranger < 40; ++stranger) {
    Answer strange = good(8, 1);
    strange.sender = process(static_cast<std::uint8_t>(100 + stranger));
    strange.server = 100U + stranger;
    EXPECT_EQ(gate.judge(strange, true, kNow), AnswerVerdict::overtaken);
  }
  EXPECT_EQ(gate.judge(good(9, 3), true, kNow), AnswerVerdict::repeated);
}

TEST(AnswerGate, ANewSessionBelievesNothingOfTheLast) {
  AnswerGate gate = begun();
  gate.begin(6);
  Answer answer = good(10, 1);
  EXPECT_EQ(gate.judge(answer, true, kNow), AnswerVerdict::other_epoch);
  answer.epoch = 6;
  EXPECT_EQ(gate.judge(answer, true, kNow), AnswerVerdict::unknown) << "it was shown in the session before";
  gate.begin(0);
  answer.epoch = 0;
  EXPECT_EQ(gate.judge(answer, true, kNow), AnswerVerdict::other_epoch) << "between two sessions";
}

TEST(AnswerGate, StampsAreTheRobotsAndRunForwardsWhateverIsClaimed) {
  const auto played = [](Duration queued, Duration inferred) {
    AnswerGate gate = begun();
    Answer answer = good(8, 1);
    answer.queued = queued;
    answer.inferred = inferred;
    return gate.play(answer, kNow);
  };
  const MonoTime dequeued = kNow - milliseconds(19);
  const CommandHeader honest = played(milliseconds(2), milliseconds(5));
  EXPECT_EQ(honest.dequeued_at, dequeued);
  EXPECT_EQ(honest.infer_started_at, dequeued + milliseconds(2));
  EXPECT_EQ(honest.infer_ended_at, dequeued + milliseconds(7));
  EXPECT_EQ(honest.published_at, kNow) << "the network, both ways, is in the last part";
  EXPECT_EQ(honest.outside_sensed_at, kNow - milliseconds(24)) << "what was shown, not what is claimed";
  EXPECT_EQ(honest.observation_id, 8U);
  for (const auto& [queued, inferred] : {std::pair{Duration{-5}, Duration{-5}}, std::pair{seconds(9), seconds(9)},
                                         std::pair{Duration{INT64_MIN}, Duration{INT64_MAX}}}) {
    const CommandHeader header = played(queued, inferred);
    EXPECT_LE(header.dequeued_at, header.infer_started_at);
    EXPECT_LE(header.infer_started_at, header.infer_ended_at);
    EXPECT_LE(header.infer_ended_at, header.published_at);
    EXPECT_EQ(header.dequeued_at, dequeued);
  }
}

TEST(AnswerGate, KnowsWhoseChunkIsPlayed) {
  AnswerGate gate = begun();
  EXPECT_EQ(gate.played(0).server, 0U);
  const CommandHeader first = gate.play(good(8, 31), kNow);
  EXPECT_EQ(gate.played(first.sequence).server, 7U);
  EXPECT_EQ(gate.played(first.sequence).sequence, 31U);
  EXPECT_EQ(gate.played(first.sequence + 256).server, 0U) << "a number that falls together";
  gate.begin(6);
  EXPECT_EQ(gate.played(first.sequence).server, 0U);
}

TEST(AnswerGate, TellsAServerThatItIsFollowedOnlyWhereThePolicyIsInCharge) {
  AnswerGate gate = begun();
  Observation observation;
  observation.command_sequence = gate.play(good(8, 31), kNow).sequence;
  observation.committed_from = 2;
  observation.committed_count = 3;
  AnswerGate::Followed followed = gate.followed(observation);
  EXPECT_EQ(followed.chunk.server, 7U);
  EXPECT_EQ(followed.chunk.sequence, 31U);
  EXPECT_EQ(followed.committed_from, 2U);
  EXPECT_EQ(followed.committed_count, 3U);
  observation.of_candidate = 1;  // which counts its own commands: 1, 2, 3 again
  followed = gate.followed(observation);
  EXPECT_EQ(followed.chunk.server, 0U);
  EXPECT_EQ(followed.chunk.sequence, 0U);
  EXPECT_EQ(followed.committed_from, 0U);
  EXPECT_EQ(followed.committed_count, 0U);
}

constexpr MonoTime at(std::int64_t ms) {
  return kNow + milliseconds(ms);
}

TEST(ServerChoice, FollowsOneWhileItSpeaks) {
  ServerChoice choice(milliseconds(60), milliseconds(500));
  EXPECT_TRUE(choice.take(process(1), at(0)));
  for (int i = 1; i < 100; ++i) {
    EXPECT_FALSE(choice.take(process(2), at(20 * i - 10)));
    EXPECT_TRUE(choice.take(process(1), at(20 * i)));
  }
  EXPECT_EQ(choice.changes(), 1U);
}

TEST(ServerChoice, ASilentLeaderLosesTheLeadForGood) {
  ServerChoice choice(milliseconds(60), milliseconds(500));
  for (int i = 0; i < 20; ++i) choice.take(process(1), at(20 * i));
  EXPECT_FALSE(choice.take(process(2), at(380 + 60)));
  EXPECT_TRUE(choice.take(process(2), at(380 + 61)));
  EXPECT_FALSE(choice.take(process(1), at(380 + 62))) << "it is back, and follows now";
  EXPECT_EQ(choice.leader(), process(2));
}

TEST(ServerChoice, ASlowLeaderIsGivenItsUsualPauseTwiceAndNoMoreThanTheLongest) {
  ServerChoice choice(milliseconds(60), milliseconds(500));
  for (int i = 0; i < 20; ++i) choice.take(process(1), at(100 * i));
  EXPECT_FALSE(choice.take(process(2), at(1900 + 200)));
  EXPECT_TRUE(choice.take(process(2), at(1900 + 201)));
  ServerChoice very_slow(milliseconds(60), milliseconds(500));
  for (int i = 0; i < 20; ++i) very_slow.take(process(1), at(400 * i));
  EXPECT_EQ(very_slow.patience(), milliseconds(500));
  EXPECT_TRUE(very_slow.take(process(2), at(7600 + 501)));
}

// An answer may rest on samples from before those that came with its observation; it becomes older by that, and by no
// claim younger.
TEST(AnswerGate, AnAnswerThatRestsOnOlderSamplesIsAsOldAsThose) {
  for (const auto& [claimed, expected] :
       {std::pair{Duration{}, milliseconds(4)}, std::pair{milliseconds(30), milliseconds(34)},
        std::pair{milliseconds(-30), milliseconds(4)}}) {
    AnswerGate gate = begun();
    Answer answer = good(10, 1);
    answer.older = claimed;
    ASSERT_EQ(gate.judge(answer, true, kNow), AnswerVerdict::usable);
    EXPECT_EQ((kNow - gate.play(answer, kNow).outside_sensed_at).ns, expected.ns);
  }
  AnswerGate gate = begun();
  Answer absurd = good(10, 1);
  absurd.older = {INT64_MAX};
  ASSERT_EQ(gate.judge(absurd, true, kNow), AnswerVerdict::usable);
  EXPECT_EQ(gate.play(absurd, kNow).outside_sensed_at.ns, 1) << "as old as a stamp can be, and set";
}

}  // namespace
}  // namespace takt::policy_host::remote
