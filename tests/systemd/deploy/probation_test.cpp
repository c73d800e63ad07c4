// SPDX-License-Identifier: Apache-2.0
// Goal: a deployment passes only by tracking for its whole watch; everything else fails it or leaves it unproven.
// Method: statuses by the tenth of a second from a script, one letter each:
//   - no answer        p no policy yet   s standby   a arming   t tracking   d degraded   x damped stop   f fault
//   R the executive counts its ticks anew   m standby and no monitor   u tracking and no monitor
//   w standby and no fallback policy   v tracking and no fallback policy
#include "systemd/deploy/probation.hpp"

#include <gtest/gtest.h>

#include <string>

namespace takt::deploy {
namespace {

constexpr ProbationTimes kTimes{.start_within = seconds(1), .arm_within = seconds(1), .watch = seconds(1)};

Mode mode_of(char letter) {
  switch (letter) {
    case 'a':
      return Mode::arming;
    case 't':
    case 'u':
    case 'v':
      return Mode::tracking;
    case 'd':
      return Mode::degraded;
    case 'x':
      return Mode::damped_stop;
    case 'f':
      return Mode::fault_latched;
    default:
      return Mode::standby;
  }
}

struct Ended {
  Stage stage = Stage::starting;
  std::string reason;
};

Ended judged(const std::string& script, WantedHosts wanted = {}) {
  Probation probation(kTimes, wanted, "/run/takt");
  Ended ended;
  std::uint64_t ticks = 1000;
  for (std::size_t i = 0; i < script.size(); ++i) {
    std::optional<StatusSnapshot> status;
    if (script[i] != '-') {
      status.emplace();
      ticks = script[i] == 'R' ? 1 : ticks + 100;
      status->ticks = ticks;
      status->policy_pids[Seat::policy] = script[i] == 'p' ? 0 : 7;
      status->policy_pids[Seat::fallback] = script[i] == 'w' || script[i] == 'v' ? 0 : 9;
      status->monitor_pid = script[i] == 'm' || script[i] == 'u' ? 0 : 8;
      status->tick.mode = mode_of(script[i]);
    }
    ended.stage = probation.look(milliseconds(100) * static_cast<std::int64_t>(i), status);
    ended.reason = probation.reason();
  }
  return ended;
}

std::string times(int count, char letter) {
  return std::string(static_cast<std::size_t>(count), letter);
}

TEST(Probation, TrackingForTheWholeWatchPasses) {
  EXPECT_EQ(judged("--ps" + times(3, 's') + "aa" + times(11, 't')).stage, Stage::passed);
  EXPECT_EQ(judged("--ps" + times(3, 's') + "aa" + times(10, 't')).stage, Stage::proving) << "not yet";
}

TEST(Probation, TroubleWhileTrackingFails) {
  const std::string begun = "--ss" + times(5, 't');
  EXPECT_EQ(judged(begun + "d" + times(20, 't')).stage, Stage::failed) << "recovered, and failed all the same";
  EXPECT_NE(judged(begun + "d").reason.find("was degraded"), std::string::npos);
  EXPECT_EQ(judged(begun + "x").stage, Stage::failed);
  EXPECT_EQ(judged(begun + "f").stage, Stage::failed);
  EXPECT_EQ(judged(begun + "s").stage, Stage::failed) << "stopped between two looks";
  EXPECT_EQ(judged(begun + "-").stage, Stage::failed);
  EXPECT_NE(judged(begun + "R").reason.find("restarted"), std::string::npos);
}

TEST(Probation, ARobotThatDoesNotComeUpFails) {
  EXPECT_EQ(judged(times(10, '-')).stage, Stage::starting);
  EXPECT_NE(
      judged(times(12, '-')).reason.find("no executive answers in /run/takt; --runtime-dir names another directory"),
      std::string::npos);
  EXPECT_NE(judged(times(12, 'p')).reason.find("no policy is attached"), std::string::npos);
  EXPECT_EQ(judged(times(5, 'p') + times(11, 't'), {.policy = false}).stage, Stage::passed)
      << "a robot without a policy needs none";
  EXPECT_EQ(judged("ssf").stage, Stage::failed);
}

TEST(Probation, ARobotThatNobodyRecordsFails) {
  EXPECT_NE(judged(times(12, 'm')).reason.find("no monitor is attached"), std::string::npos);
  EXPECT_EQ(judged("mms" + times(11, 't')).stage, Stage::passed) << "it may come last";
  EXPECT_NE(judged("ssm").reason.find("monitor has left"), std::string::npos)
      << "one that ends as soon as it has attached";
  EXPECT_NE(judged("sstttu").reason.find("monitor has left"), std::string::npos);
}

TEST(Probation, ARobotWithoutItsFallbackPolicyFails) {
  constexpr WantedHosts kBoth{.policy = true, .fallback = true};
  EXPECT_NE(judged(times(12, 'w'), kBoth).reason.find("no fallback policy is attached"), std::string::npos);
  EXPECT_EQ(judged("wws" + times(11, 't'), kBoth).stage, Stage::passed) << "it may come last";
  EXPECT_NE(judged("sstttv", kBoth).reason.find("fallback policy's host has left"), std::string::npos);
  EXPECT_EQ(judged("wws" + times(5, 'v') + times(6, 't')).stage, Stage::passed) << "a robot that has none needs none";
}

TEST(Probation, WhatNobodyArmsIsUnproven) {
  EXPECT_EQ(judged("--" + times(14, 's')).stage, Stage::unproven);
  EXPECT_EQ(judged("--" + times(14, 's') + times(20, 't')).stage, Stage::unproven) << "over is over";
}

}  // namespace
}  // namespace takt::deploy
