// SPDX-License-Identifier: Apache-2.0
// Goal: a disk does not fill up while record.keep says what may go, and what tells something of the robot goes last.
// Method: run folders of written ages, sizes and stories; ninety days of a small disk, a part a turn, without waiting.
#include "monitor/record/run_shelf.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/monitor/record/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kGib = std::uint64_t{1} << 30U;
constexpr std::int64_t kDay_ns = std::int64_t{86'400} * 1'000'000'000;
constexpr std::int64_t kNow = 20'000 * kDay_ns;

ShelvedRun run_of(int days_ago, std::uint64_t gib, bool is_telling = false) {
  return {.folder = "/runs/" + std::to_string(days_ago),
          .name = std::to_string(days_ago),
          .robot = demo_robot().robot,
          .began_unix_ns = kNow - days_ago * kDay_ns,
          .seconds = 3'600,
          .bytes = gib * kGib,
          .ended = "executive ended",
          .goes_on = false,
          .is_kept = false,
          .is_telling = is_telling};
}
config::RobotConfig keeping(std::optional<int> days, std::optional<int> gib) {
  config::RobotConfig robot = demo_robot();
  robot.record.keep = {days, gib};
  return robot;
}
std::vector<std::string> names(const std::vector<ShelvedRun>& runs) {
  std::vector<std::string> names;
  for (const ShelvedRun& run : runs) names.push_back(run.name);
  return names;
}
using Names = std::vector<std::string>;

TEST(Pruning, WithoutALimitNothingGoes) {
  EXPECT_EQ(names(to_prune({run_of(9'000, 500)}, demo_robot(), 0, kNow)), Names{});
}

TEST(Pruning, WhatTellsSomethingGoesLast) {
  const std::vector<ShelvedRun> runs{run_of(40, 10, true), run_of(35, 10), run_of(20, 10), run_of(10, 10, true),
                                     run_of(1, 10)};
  EXPECT_EQ(names(to_prune(runs, keeping(30, {}), 100 * kGib, kNow)), Names{"35"}) << "not the incident of day 40";
  EXPECT_EQ(names(to_prune(runs, keeping({}, 30), 100 * kGib, kNow)), (Names{"35", "20"}));
  EXPECT_EQ(names(to_prune(runs, keeping({}, 10), 100 * kGib, kNow)), (Names{"35", "20", "1", "40"}));
  EXPECT_EQ(names(to_prune(runs, keeping(30, {}), kGib, kNow)), Names{"35"}) << "that made room enough";
  EXPECT_EQ(names(to_prune(runs, keeping(50, {}), kGib, kNow)), Names{"35"}) << "a full disk asks for more than days";
}

TEST(Pruning, SomeRunsNeverGo) {
  std::vector<ShelvedRun> runs{run_of(9, 10), run_of(8, 10), run_of(7, 10)};
  runs[0].is_kept = true;
  runs[1].goes_on = true;
  runs[2].robot = "another";
  EXPECT_EQ(names(to_prune(runs, keeping(1, 1), 0, kNow)), Names{});
}

// A 20 GiB disk, a part of 1 GiB every two hours, an incident in every tenth; a turn is what the monitor does.
TEST(Pruning, NinetyDaysOfASmallDisk) {
  constexpr int kParts = 90 * 12;
  const config::RobotConfig robot = keeping(30, 15);
  std::vector<ShelvedRun> disk;
  int telling_lost = 0;
  for (int part = 0; part < kParts; ++part) {
    ShelvedRun next = run_of(0, 1, part % 100 == 0);
    next.began_unix_ns = kNow + part * kDay_ns / 12;
    next.name = next.folder = std::to_string(part);
    disk.push_back(next);
    std::uint64_t used = 0;
    for (const ShelvedRun& run : disk) used += run.bytes;
    ASSERT_LE(used, 20 * kGib) << "full at part " << part;
    for (const ShelvedRun& gone : to_prune(disk, robot, 20 * kGib - used, next.began_unix_ns)) {
      telling_lost += gone.is_telling ? 1 : 0;
      std::erase_if(disk, [&](const ShelvedRun& run) { return run.name == gone.name; });
    }
  }
  EXPECT_EQ(telling_lost, 0);
}

TEST(HoursLeft, AreAtThePaceOfTheNewestRuns) {
  const auto hours = [](const std::vector<ShelvedRun>& runs, std::uint64_t gib) {
    return hours_left(runs, demo_robot(), gib * kGib);
  };
  EXPECT_DOUBLE_EQ(hours({run_of(9, 50), run_of(1, 2)}, 100), 50) << "2 GiB an hour now";
  ShelvedRun other = run_of(0, 90);
  other.robot = "another";
  EXPECT_DOUBLE_EQ(hours({run_of(1, 2), other}, 100), 50);
  EXPECT_GT(hours({}, 100), 24) << "no run tells a pace";
  EXPECT_LT(hours({}, 1), 24);
  EXPECT_TRUE(std::isinf(hours_left({run_of(1, 2)}, keeping(30, 100), 100 * kGib)));
  ShelvedRun kept = run_of(1, 2);
  kept.is_kept = true;
  EXPECT_DOUBLE_EQ(hours_left({kept}, keeping(30, 100), 3 * kGib), 1.5) << "there is nothing to delete";
}

class RunShelfTest : public TemporaryFolder {};

TEST_F(RunShelfTest, TellsWhatLiesThere) {
  VirtualRobot robot;
  RecordedRun run = record(robot, path("20230101T000000Z-arm6-000001"), 400, [](std::uint64_t) {});
  std::filesystem::create_directory(path("no run"));
  auto runs = runs_in(path(""), kNow);
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_EQ(runs[0].name, "20230101T000000Z-arm6-000001");
  EXPECT_EQ(runs[0].robot, demo_robot().robot);
  EXPECT_EQ(runs[0].ended, "test over");
  EXPECT_NEAR(runs[0].seconds, 0.4, 0.01);
  EXPECT_GT(runs[0].bytes, std::filesystem::file_size(run.folder.ticks()));
  EXPECT_TRUE(runs[0].is_telling) << "without metrics.json nobody knows";
  ASSERT_TRUE(write_metrics(run));
  EXPECT_FALSE(runs_in(path(""), kNow)[0].is_telling);
  const auto metrics = nlohmann::ordered_json::parse(read_file(run.folder.metrics()).value());
  const auto is_telling_with = [&](const auto& change) {
    auto json = metrics;
    change(json);
    EXPECT_TRUE(replace_file(run.folder.metrics(), json.dump()));
    return runs_in(path(""), kNow)[0].is_telling;
  };
  const auto incident = [](bool asked) {
    return [asked](auto& json) { json["incident_count"] = 1, json["incidents"].push_back({{"asked", asked}}); };
  };
  EXPECT_TRUE(is_telling_with([](auto& json) { json["mark_count"] = 1; }));
  EXPECT_TRUE(is_telling_with(incident(false)));
  EXPECT_FALSE(is_telling_with(incident(true))) << "an operator's stop tells nothing";
  EXPECT_TRUE(is_telling_with([](auto& json) { json["incident_count"] = 1; })) << "more than are listed";
  EXPECT_FALSE(runs_in(path(""), kNow)[0].is_kept);
  ASSERT_TRUE(keep_run(run.folder.path()));
  EXPECT_TRUE(runs_in(path(""), kNow)[0].is_kept);
  EXPECT_FALSE(keep_run(path("no run")));
  run.manifest.ended_at = {};
  ASSERT_TRUE(run.folder.write_manifest(run.manifest));
  EXPECT_TRUE(runs_in(path(""), kNow)[0].goes_on) << "ticks.mcap was written to just now";
}

TEST_F(RunShelfTest, PruningDeletesFolders) {
  VirtualRobot robot;
  const RecordedRun old = record(robot, path("old"), 200, [](std::uint64_t) {});
  VirtualRobot again;
  const RecordedRun kept = record(again, path("kept"), 200, [](std::uint64_t) {});
  ASSERT_TRUE(write_metrics(old) && write_metrics(kept) && keep_run(kept.folder.path()));
  config::RobotConfig keeps = keeping(1, {});
  keeps.record.directory = path("");
  auto runs = runs_in(path(""), kNow);
  EXPECT_EQ(names(prune(runs, keeps, kNow + 9'000 * kDay_ns)), Names{"old"});
  EXPECT_EQ(names(runs), Names{"kept"});
  EXPECT_FALSE(std::filesystem::exists(path("old")));
  EXPECT_TRUE(std::filesystem::exists(path("kept") + "/ticks.mcap"));
}

}  // namespace
}  // namespace takt::monitor
