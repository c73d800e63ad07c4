// SPDX-License-Identifier: Apache-2.0
// Goal: a disk does not fill up while record.keep says what may go, and what tells something of the robot stays.
// Method: run folders of written ages, sizes and stories; ninety days of a small disk, a part a turn, without waiting.
#include "monitor/record/run_shelf.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kGib = std::uint64_t{1} << 30U;
constexpr std::int64_t kDay_ns = std::int64_t{86'400} * 1'000'000'000;
constexpr std::int64_t kNow = 20'000 * kDay_ns;

enum class Story : std::uint8_t { none, telling, unknown };

ShelvedRun run_of(int days_ago, std::uint64_t gib, Story story = Story::none) {
  return {.folder = "/runs/" + std::to_string(days_ago),
          .name = std::to_string(days_ago),
          .robot = demo_robot().robot,
          .began_unix_ns = kNow - days_ago * kDay_ns,
          .seconds = 3'600,
          .bytes = gib * kGib,
          .ended = "executive ended",
          .goes_on = false,
          .is_kept = false,
          .is_telling = story == Story::telling,
          .is_unknown = story == Story::unknown};
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

TEST(Pruning, WhatTellsSomethingStaysAndWhatIsUnknownGoesLast) {
  const std::vector<ShelvedRun> runs{run_of(41, 10, Story::telling),
                                     run_of(40, 10, Story::unknown),
                                     run_of(35, 10),
                                     run_of(20, 10),
                                     run_of(10, 10, Story::telling),
                                     run_of(1, 10)};
  EXPECT_EQ(names(to_prune(runs, keeping(30, {}), 100 * kGib, kNow)), Names{"35"});
  EXPECT_EQ(names(to_prune(runs, keeping({}, 40), 100 * kGib, kNow)), (Names{"35", "20"}));
  EXPECT_EQ(names(to_prune(runs, keeping({}, 10), 100 * kGib, kNow)), (Names{"35", "20", "1", "40"}));
  EXPECT_EQ(names(to_prune(runs, keeping(1, 1), 0, kNow)), (Names{"35", "20", "1", "40"})) << "never the incidents";
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

// A 20 GiB disk, a part of 1 GiB every two hours, an incident in every hundredth; a turn is what the monitor does.
TEST(Pruning, NinetyDaysOfASmallDisk) {
  constexpr int kParts = 90 * 12;
  const config::RobotConfig robot = keeping(30, 15);
  std::vector<ShelvedRun> disk;
  int telling_lost = 0;
  for (int part = 0; part < kParts; ++part) {
    ShelvedRun next = run_of(0, 1, part % 100 == 0 ? Story::telling : Story::none);
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
  EXPECT_DOUBLE_EQ(hours_left({run_of(1, 2, Story::telling)}, keeping(30, 100), 3 * kGib), 1.5);
  ShelvedRun stuck = run_of(1, 2);
  stuck.is_stuck = true;
  EXPECT_DOUBLE_EQ(hours_left({stuck}, keeping(30, 100), 3 * kGib), 1.5);
}

class RunShelfTest : public test::TemporaryFolder {};

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
  EXPECT_TRUE(runs[0].is_unknown) << "without metrics.json";
  EXPECT_FALSE(runs[0].is_telling) << "by its transitions";
  const std::string transitions = read_file(run.folder.transitions()).value();
  const auto is_telling_by = [&](const std::string& lines) {
    EXPECT_TRUE(replace_file(run.folder.transitions(), transitions + lines));
    return runs_in(path(""), kNow)[0].is_telling;
  };
  EXPECT_TRUE(is_telling_by(R"({"to":"damped_stop","cause":"command_lost"})"
                            "\n"));
  EXPECT_FALSE(is_telling_by(R"({"to":"damped_stop","cause":"operator_stop"})"
                             "\n"));
  EXPECT_FALSE(is_telling_by("[]\nnot JSON\n{\"to\":1}\n{\"to\":\"damped_stop\",\"cau"));
  std::filesystem::remove(run.folder.transitions());
  std::filesystem::create_directory(run.folder.transitions());
  EXPECT_TRUE(runs_in(path(""), kNow)[0].is_telling) << "what cannot be read may tell something";
  std::filesystem::remove(run.folder.transitions());
  ASSERT_TRUE(replace_file(run.folder.transitions(), transitions));
  ASSERT_TRUE(write_metrics(run));
  EXPECT_FALSE(runs_in(path(""), kNow)[0].is_telling || runs_in(path(""), kNow)[0].is_unknown);
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
  const Pruned pruned = prune(runs, keeps, kNow + 9'000 * kDay_ns);
  EXPECT_EQ(names(pruned.gone), Names{"old"});
  EXPECT_EQ(pruned.failures, Names{});
  EXPECT_EQ(names(runs), Names{"kept"});
  EXPECT_FALSE(std::filesystem::exists(path("old")));
  EXPECT_TRUE(std::filesystem::exists(path("kept") + "/ticks.mcap"));
}

class PruningTest : public RunShelfTest {
 protected:
  // An old, closed run of the demo robot that tells nothing.
  RunFolder old_run(const std::string& name) {
    VirtualRobot robot;
    const RecordedRun run = record(robot, path(name), 200, [](std::uint64_t) {});
    EXPECT_TRUE(write_metrics(run));
    return run.folder;
  }
  Pruned prune_all() {
    config::RobotConfig keeps = keeping(1, 1);
    keeps.record.directory = path("runs");
    runs_ = runs_in(path("runs"), kNow);
    return prune(runs_, keeps, kNow + 9'000 * kDay_ns);
  }
  std::vector<ShelvedRun> runs_;
};

// Goal: no link leads out of the folder of the runs. Method: links to a run, to its files and to folders elsewhere.
TEST_F(PruningTest, FollowsNoLink) {
  namespace fs = std::filesystem;
  const RunFolder run = old_run("runs/run");
  const RunFolder outside = old_run("outside/run");
  fs::create_directory(path("pictures"));
  ASSERT_TRUE(replace_file(path("pictures/1.pgm"), "a picture"));
  fs::create_directory_symlink(path("outside/run"), path("runs/run.2"));
  fs::create_directory_symlink(path("pictures"), run.images());
  fs::create_symlink(outside.ticks(), run.path() + "/more.mcap");
  fs::create_directory_symlink(path("runs"), run.path() + "/loop");
  fs::create_directory(path("runs/run.3"));
  fs::create_symlink("/dev/zero", path("runs/run.3/manifest.json"));
  fs::create_directory(path("runs/run.4"));
  ASSERT_EQ(::mkfifo(path("runs/run.4/manifest.json").c_str(), 0600), 0);
  fs::create_directory(path("runs/run.5"));
  ASSERT_TRUE(replace_file(path("runs/run.5/manifest.json"), ""));
  fs::resize_file(path("runs/run.5/manifest.json"), std::uintmax_t{1} << 34U);
  EXPECT_EQ(names(prune_all().gone), Names{"run"});
  EXPECT_FALSE(fs::exists(run.path()));
  EXPECT_TRUE(fs::exists(outside.ticks()));
  EXPECT_TRUE(fs::exists(path("pictures/1.pgm")));
  EXPECT_TRUE(fs::is_symlink(path("runs/run.2")));
  EXPECT_TRUE(fs::exists(path("runs/run.5/manifest.json"))) << "no run folder";
}

// Goal: what a recorder holds stays, however long it wrote nothing, as when it was stopped or its clock was set.
// Method: a run that by its files is old and closed, whose ticks.mcap is open as a recorder has it; then the recorder
// is gone.
TEST_F(PruningTest, WhatARecorderHoldsStays) {
  const RunFolder run = old_run("runs/run");
  std::filesystem::remove(run.ticks());
  {
    const auto held = BoundedFile::create(run.ticks(), 1);
    EXPECT_TRUE(is_being_written(run.ticks()));
    std::filesystem::last_write_time(run.ticks(), {});
    EXPECT_EQ(names(prune_all().gone), Names{});
    EXPECT_TRUE(runs_.at(0).goes_on);
    for (ShelvedRun& each : runs_) each.goes_on = false;  // it was opened since
    config::RobotConfig keeps = keeping(1, 1);
    keeps.record.directory = path("runs");
    EXPECT_EQ(names(prune(runs_, keeps, kNow + 9'000 * kDay_ns).gone), Names{});
  }
  EXPECT_FALSE(is_being_written(run.ticks()));
  EXPECT_EQ(names(prune_all().gone), Names{"run"});
}

// Goal: a mark that comes while others are deleted counts. Method: listed first, kept then; a link at `kept` is one.
TEST_F(PruningTest, KeepsWhatWasMarkedMeanwhile) {
  const RunFolder first = old_run("runs/first"), second = old_run("runs/second");
  config::RobotConfig keeps = keeping(1, 1);
  keeps.record.directory = path("runs");
  auto runs = runs_in(path("runs"), kNow);
  ASSERT_TRUE(keep_run(first.path()));
  std::filesystem::create_symlink("nowhere", second.path() + "/kept");
  EXPECT_EQ(names(prune(runs, keeps, kNow + 9'000 * kDay_ns).gone), Names{});
  EXPECT_EQ(names(prune_all().gone), Names{});
}

// Goal: a folder of very many folders costs a monitor, which looks once a minute, little. Method: ten thousand, as many
// as one session may have parts, of which all but one are no run; by CPU time.
TEST_F(PruningTest, ManyFoldersAreListedInSeconds) {
  (void)old_run("runs/run");
  for (int i = 2; i <= 10'000; ++i) std::filesystem::create_directory(path("runs/run." + std::to_string(i)));
  const std::clock_t began = std::clock();
  EXPECT_EQ(runs_in(path("runs"), kNow).size(), 1U);
  EXPECT_LT(std::clock() - began, 10 * CLOCKS_PER_SEC);
}

}  // namespace
}  // namespace takt::monitor
