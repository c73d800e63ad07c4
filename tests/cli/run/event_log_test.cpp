// SPDX-License-Identifier: Apache-2.0
// Goal: every event is in the run folder as soon as there is one, in order, also those of before. Method: a folder that
// is made between two events.
#include "cli/run/event_log.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "monitor/record/run_events.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::cli {
namespace {

using EventLogTest = test::TemporaryFolder;

TEST_F(EventLogTest, WhatIsNotedBeforeThereIsAFolderWaitsForIt) {
  EventLog log(path("run"));
  log.note("run", {{"command", {"takt", "run"}}}, MonoTime{1});
  EXPECT_FALSE(std::filesystem::exists(path("run")));
  std::filesystem::create_directory(path("run"));
  log.note("script", {{"given", "--at '3 s: kill policy'"}, {"action", "kill"}, {"length_ns", 7}}, MonoTime{2});
  log.note("ended", {{"process", "takt-policy-host"}, {"how", "was killed by SIGKILL"}}, MonoTime{3});
  std::ofstream(path("run/events.jsonl"), std::ios::app) << "{\"event\":\"cut o";
  const auto events = monitor::read_run_events(monitor::RunFolder(path("run")));
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[0].event, "run");
  EXPECT_EQ(events[1].given, "--at '3 s: kill policy'");
  EXPECT_EQ(events[1].action, "kill");
  EXPECT_EQ(events[1].length, nanoseconds(7));
  EXPECT_EQ(events[2].at, MonoTime{3});
  EXPECT_EQ(events[2].how, "was killed by SIGKILL");
  EXPECT_TRUE(events[2].is_sealed) << "no seal tells which came later";
}

}  // namespace
}  // namespace takt::cli
