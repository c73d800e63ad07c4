// SPDX-License-Identifier: Apache-2.0
// Goal: the newest that a policy's host says of itself stands and is told once, however fast it speaks; what came too
// fast is counted; a recorder that comes later is told what stands. Method: words and time by hand.
#include "executive/runtime/policy_words.hpp"

#include <gtest/gtest.h>

#include <string>

namespace takt::runtime {
namespace {

constexpr MonoTime kNow{1'000'000'000};

PolicyWord word(const std::string& sentence, PolicyWordKind kind = PolicyWordKind::problem, Role role = Role::policy) {
  PolicyWord word;
  word.kind = kind;
  word.role = role;
  sentence.copy(word.sentence, sizeof word.sentence - 1);
  return word;
}

TEST(PolicyWords, TellsWhatIsNewOnceAndThatItIsOver) {
  PolicyWords words;
  words.take(word("no sensor"), kNow);
  EXPECT_EQ(words.problem(Role::policy), "no sensor");
  EXPECT_EQ(words.problem(Role::fallback_policy), "");
  ASSERT_EQ(words.take_due(kNow).size(), 1U);
  EXPECT_TRUE(words.take_due(kNow).empty());
  words.take(word("no sensor"), kNow + seconds(1));
  EXPECT_TRUE(words.take_due(kNow + seconds(1)).empty()) << "the same again";
  words.take(word(""), kNow + seconds(2));
  const auto over = words.take_due(kNow + seconds(2));
  ASSERT_EQ(over.size(), 1U);
  EXPECT_EQ(std::string(over[0].sentence), "");
  EXPECT_EQ(over[0].heard_at, kNow + seconds(2));
  EXPECT_EQ(words.problem(Role::policy), "");
}

// Goal: an incident keeps its sensor's name after the sensor is back.
TEST(PolicyWords, AProblemThatIsOverIsStillWhyItStoppedThen) {
  PolicyWords words;
  words.take(word("no sensor"), kNow);
  words.take(word(""), kNow + seconds(2));
  EXPECT_EQ(words.problem_since(Role::policy, kNow + seconds(1)), "no sensor");
  EXPECT_EQ(words.problem_since(Role::policy, kNow + seconds(3)), "") << "of a later incident it is no reason";
  words.take(word("too slow"), kNow + seconds(4));
  EXPECT_EQ(words.problem_since(Role::policy, kNow + seconds(3)), "too slow");
}

// Threat: policy-words
TEST(PolicyWords, WhoSpeaksTooFastIsToldByItsNewestAndTheOthersAreCounted) {
  PolicyWords words;
  std::size_t told = 0;
  for (int i = 0; i < 1000; ++i) {
    words.take(word("problem " + std::to_string(i)), kNow + milliseconds(i));
    told += words.take_due(kNow + milliseconds(i)).size();
  }
  EXPECT_EQ(told, PolicyWords::kBurst);
  EXPECT_EQ(words.problem(Role::policy), "problem 999") << "who asks now is told the newest";
  words.take(word("beside", PolicyWordKind::problem, Role::candidate_policy), kNow + seconds(1));
  EXPECT_EQ(words.take_due(kNow + seconds(1)).size(), 1U) << "each seat has its own measure";
  const auto later = words.take_due(kNow + PolicyWords::kWindow);
  ASSERT_EQ(later.size(), 1U);
  EXPECT_EQ(std::string(later[0].sentence), "problem 999");
  EXPECT_EQ(later[0].superseded, 1000 - PolicyWords::kBurst - 1);
}

TEST(PolicyWords, TellsALateRecorderWhatStands) {
  PolicyWords words;
  words.take(word("server far", PolicyWordKind::source), kNow);
  words.take(word("no sensor"), kNow);
  words.take(word(""), kNow);
  words.take_due(kNow);
  words.tell_all_again();
  const auto again = words.take_due(kNow);
  ASSERT_EQ(again.size(), 1U) << "a problem that is over is none";
  EXPECT_EQ(std::string(again[0].sentence), "server far");
}

TEST(PolicyWords, AHostThatLeftIsTheReasonUntilTheNextComes) {
  PolicyWords words;
  words.take(word("server far", PolicyWordKind::source), kNow);
  words.end(Role::policy, "its host left", kNow);
  EXPECT_EQ(words.problem(Role::policy), "its host left");
  ASSERT_EQ(words.take_due(kNow).size(), 1U) << "whose commands it played matters no more";
  words.begin(Role::policy, kNow + seconds(1));
  EXPECT_EQ(words.problem(Role::policy), "");
  EXPECT_EQ(words.take_due(kNow + seconds(1)).size(), 1U);
  words.take(word("server far", PolicyWordKind::source), kNow + seconds(1));
  EXPECT_EQ(words.take_due(kNow + seconds(1)).size(), 1U) << "a session of its own, from its first command on";
}

TEST(PolicyWords, WhatIsPresumedOfASilentHostGivesWayToItsWordAndToItsCommands) {
  PolicyWords words;
  words.presume(Role::policy, "it hangs", kNow);
  EXPECT_EQ(words.problem(Role::policy), "it hangs");
  words.presume(Role::policy, "it gets no observation", kNow);
  EXPECT_EQ(words.problem(Role::policy), "it gets no observation") << "what is known by now";
  words.answers(Role::policy, kNow);
  EXPECT_EQ(words.problem(Role::policy), "");
  words.presume(Role::policy, "it hangs", kNow);
  words.take(word("no sensor"), kNow);
  EXPECT_EQ(words.problem(Role::policy), "no sensor");
  words.presume(Role::policy, "it hangs", kNow);
  words.answers(Role::policy, kNow);
  EXPECT_EQ(words.problem(Role::policy), "no sensor") << "its own word is taken back by itself alone";
}

}  // namespace
}  // namespace takt::runtime
