// SPDX-License-Identifier: Apache-2.0
// Goal: a stop ends the asking of a process that waits to arm, and of no other. Method: processes by their numbers,
// time by hand.
#include "executive/runtime/pending_arms.hpp"

#include <gtest/gtest.h>

namespace takt::runtime {
namespace {

constexpr pid_t kRun = 7, kPerson = 8;
constexpr Duration kPoll = milliseconds(20);

TEST(PendingArms, AStopEndsTheAskingOfWhoAskedBeforeIt) {
  PendingArms pending;
  MonoTime now{seconds(10).ns};
  for (int time = 0; time < 50; ++time) EXPECT_FALSE(pending.is_ended(kRun, now = now + kPoll));
  pending.stop();
  EXPECT_FALSE(pending.is_ended(kPerson, now)) << "takt arm, after the stop";
  for (int time = 0; time < 500; ++time) EXPECT_TRUE(pending.is_ended(kRun, now = now + kPoll)) << "it goes on asking";
  EXPECT_FALSE(pending.is_ended(kRun, now + PendingArms::kForgottenAfter + kPoll)) << "asked anew";
}

TEST(PendingArms, WhatWasGrantedIsNotPending) {
  PendingArms pending;
  const MonoTime now{seconds(10).ns};
  EXPECT_FALSE(pending.is_ended(kPerson, now));
  pending.forget(kPerson);
  pending.stop();
  EXPECT_FALSE(pending.is_ended(kPerson, now + kPoll)) << "top: armed, stopped, reset, armed again";
}

TEST(PendingArms, ManyAskersPushOutTheOneNotHeardForLongest) {
  PendingArms pending;
  MonoTime now{seconds(10).ns};
  for (pid_t pid = 1; pid <= 40; ++pid) EXPECT_FALSE(pending.is_ended(pid, now = now + Duration{1}));
  pending.stop();
  EXPECT_TRUE(pending.is_ended(40, now));
}

}  // namespace
}  // namespace takt::runtime
