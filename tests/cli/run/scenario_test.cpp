// SPDX-License-Identifier: Apache-2.0
// Goal: --at lines become the events that they say, in order, or are refused. Method: tables; what a line may say is in
// tests/config/trouble/line_test.cpp.
#include "cli/run/scenario.hpp"

#include <gtest/gtest.h>

#include "cli/run/cpu_hog.hpp"

namespace takt::cli {
namespace {

TEST(Scenario, EventsComeInOrderOfTimeAndAFreezeBringsItsThaw) {
  const auto events = parse_scenario({"14s: kill policy", "8 s: freeze policy 300ms", "1.5s: stop"});
  ASSERT_TRUE(events.has_value()) << events.error();
  ASSERT_EQ(events->size(), 4U);
  EXPECT_EQ((*events)[0].action, ActionKind::stop);
  EXPECT_EQ((*events)[0].at, milliseconds(1500));
  EXPECT_EQ((*events)[1].action, ActionKind::freeze);
  EXPECT_EQ((*events)[2].action, ActionKind::thaw);
  EXPECT_EQ((*events)[2].at, milliseconds(8300));
  EXPECT_EQ((*events)[3].action, ActionKind::kill);
  EXPECT_EQ((*events)[3].process, ProcessName::policy);
}

TEST(Scenario, TakesAFreezeAsItIsTold) {
  const auto told = parse_scenario({"8s: freeze policy 300ms"});
  ASSERT_EQ(as_given(told->front()), "--at '8 s: freeze policy for 300 ms'");
  const auto again = parse_scenario({"8 s: freeze policy for 300 ms"});
  ASSERT_TRUE(again.has_value()) << again.error();
  EXPECT_EQ(again->front().length, milliseconds(300));
  EXPECT_EQ(as_given(again->front()), as_given(told->front()));
}

TEST(Scenario, RefusesWhatItDoesNotUnderstand) {
  for (const char* line : {"kill policy", "8: kill policy", "8s kill policy", "8s: kill camera", "8s: freeze policy",
                           "8s: freeze policy soon", "8s: freeze policy for", "8s: freeze policy for for 1s",
                           "8s: kill policy now", "8s: stop it", "8s:", "-1s: stop"}) {
    const auto events = parse_scenario({line});
    ASSERT_FALSE(events.has_value()) << line;
    EXPECT_EQ(events.error().find("--at '" + std::string(line) + "': "), 0U) << events.error();
  }
}

TEST(Scenario, ContentionNamesWhomItDisturbsAndEnds) {
  const auto events = parse_scenario({"1s: hog control 8ms", "2s: hog policy 400ms", "3s: crowd policy 5 2s"});
  ASSERT_TRUE(events.has_value()) << events.error();
  EXPECT_EQ((*events)[0].action, ActionKind::hog);
  EXPECT_EQ((*events)[0].process, ProcessName::executive);
  EXPECT_EQ((*events)[0].length, milliseconds(8));
  EXPECT_EQ((*events)[1].process, ProcessName::policy);
  EXPECT_EQ((*events)[2].action, ActionKind::crowd);
  EXPECT_EQ((*events)[2].count, 5U);
  EXPECT_EQ((*events)[2].length, seconds(2));
  for (const char* line :
       {"1s: hog control 2s", "1s: hog monitor 8ms", "1s: hog control", "1s: crowd policy 2s", "1s: crowd policy 0 2s",
        "1s: crowd control 2 2s", "1s: start camera", "1s: throttle policy 2s", "1s: throttle control 61s"})
    EXPECT_FALSE(parse_scenario({line}).has_value()) << line;
  EXPECT_EQ(trouble::row_of(ActionKind::hog).longest, kLongestFifoHog) << "what the hog itself refuses";
  EXPECT_EQ(trouble::row_of(ActionKind::throttle).longest, kLongestLowestFifoHog);
}

TEST(Scenario, ALoadIsTheUsersOwnCommandAndEnds) {
  const auto events = parse_scenario({"1s: load 2 400ms ./burn --all"});
  ASSERT_TRUE(events.has_value()) << events.error();
  ASSERT_EQ(events->size(), 2U);
  EXPECT_EQ((*events)[0].action, ActionKind::load);
  EXPECT_EQ((*events)[0].count, 2U);
  EXPECT_EQ((*events)[0].command, (std::vector<std::string>{"./burn", "--all"}));
  EXPECT_EQ((*events)[1].action, ActionKind::unload);
  EXPECT_EQ((*events)[1].at, milliseconds(1400));
  for (const char* line : {"1s: load 2 400ms", "1s: load 0 400ms ./burn", "1s: load ./burn", "1s: load 65 1s ./burn"})
    EXPECT_FALSE(parse_scenario({line}).has_value()) << line;
}

TEST(Scenario, WhatThePolicyHostDoesToItselfIsAnEventLikeAnother) {
  const auto events = parse_scenario(
      {"4s: kill policy"},
      {"--fault-seed=3", "--fault=3 s for 1 s: publish_delay 100 ms", "--fault", "5 s for 1 s: queue_growth 150"});
  ASSERT_TRUE(events.has_value()) << events.error();
  ASSERT_EQ(events->size(), 3U);
  EXPECT_EQ((*events)[0].action, ActionKind::fault);
  EXPECT_EQ((*events)[0].at, seconds(3));
  EXPECT_EQ((*events)[0].length, seconds(1));
  EXPECT_EQ(as_given((*events)[0]), "--policy=--fault='3 s for 1 s: publish_delay 100 ms'");
  EXPECT_EQ(as_given((*events)[1]), "--at '4 s: kill policy'");
  EXPECT_EQ((*events)[2].action, ActionKind::fault);
  const auto refused = parse_scenario({}, {"--fault=soon"});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().find("--policy=--fault 'soon': write "), 0U) << refused.error();
}

// What ends an earlier event may lie beyond the run's end, which ends it as well.
TEST(Scenario, AnInstantBeyondTheDurationIsNamed) {
  const auto checked = [](const char* line, Duration duration) {
    const auto fits = check_instants(parse_scenario({line}).value(), duration);
    return fits ? std::string() : fits.error();
  };
  EXPECT_EQ(checked("3s: kill policy", seconds(4)), "");
  EXPECT_EQ(checked("3s: freeze policy 600s", seconds(4)), "");
  EXPECT_EQ(checked("3s: load 1 600s ./burn", seconds(4)), "");
  for (const char* line : {"4s: kill policy", "9s: freeze policy 1s", "4s: load 1 1s ./burn", "4s: stop", "4s: arm"})
    EXPECT_NE(checked(line, seconds(4)).find(" would never happen: the run ends after 4 s; choose"), std::string::npos)
        << line;
  const auto fault = parse_scenario({}, {"--fault=30 s for 1 s: publish_delay 100 ms"});
  EXPECT_FALSE(check_instants(*fault, seconds(20)).has_value());
}

TEST(Scenario, DurationsMayOmitTheSpace) {
  EXPECT_EQ(parse_duration("20s"), seconds(20));
  EXPECT_EQ(parse_duration(" 300 ms "), milliseconds(300));
  EXPECT_FALSE(parse_duration("20").has_value());
  EXPECT_FALSE(parse_duration("20 m").has_value());
}

}  // namespace
}  // namespace takt::cli
