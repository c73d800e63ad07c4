// SPDX-License-Identifier: Apache-2.0
// Goal: whatever is done to a closed run folder is found, and named by its file and the ten seconds in which it was
// recorded. Method: the virtual robot recorded for 35 s; a bit turned at random places, bytes cut, added, put between,
// files taken away or made something else; a recorder that never closes its run; a file that was cut back.
#include "monitor/record/run_seal.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <filesystem>
#include <random>

#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_events.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kTicks = 35'000;  // of 1 ms
constexpr std::array kGrownFiles{"ticks.mcap", "can.log.zst", "transitions.jsonl"};

class RunSealTest : public test::TemporaryFolder {
 protected:
  void record_run() {
    VirtualRobot robot;
    record(robot, path("run"), kTicks, [](std::uint64_t) {});
  }
  [[nodiscard]] std::string file(const std::string& name) const { return path("run") + "/" + name; }
  [[nodiscard]] std::vector<std::string> altered() const {
    const auto checked = check_run_seal(RunFolder(path("run")));
    return checked ? checked->altered : std::vector<std::string>{checked.error()};
  }
  // What is said while the file holds that.
  std::vector<std::string> altered_by(const std::string& name, const std::string& content) {
    const std::string before = read_file(file(name)).value();
    EXPECT_TRUE(replace_file(file(name), content));
    auto found = altered();
    EXPECT_TRUE(replace_file(file(name), before));
    return found;
  }
};

TEST_F(RunSealTest, ARunAsItWasRecordedIsWhole) {
  record_run();
  const auto checked = check_run_seal(RunFolder(path("run")));
  ASSERT_TRUE(checked) << checked.error();
  EXPECT_TRUE(checked->closed);
  EXPECT_EQ(checked->altered, std::vector<std::string>{});
  EXPECT_EQ(checked->files, 2U) << "manifest.json and config.yaml";
  EXPECT_GE(checked->segments, 8U) << "four of each file that grows with time";
  ASSERT_TRUE(replace_file(file("metrics.json"), "{}"));
  EXPECT_EQ(altered(), std::vector<std::string>{}) << "computed from the run, and no part of it";
}

TEST_F(RunSealTest, ATurnedBitIsNamedByItsTenSeconds) {
  record_run();
  const auto seal = nlohmann::json::parse(read_file(file("seal.json")).value());
  std::mt19937 dice(27);
  for (const char* const name : kGrownFiles) {
    const std::string content = read_file(file(name)).value();
    for (int i = 0; i < 60; ++i) {
      const std::size_t at = dice() % content.size();
      std::string turned = content;
      turned[at] = static_cast<char>(turned[at] ^ (1 << (dice() % 8)));
      std::uint64_t from = 0, until = 0;
      std::string end;
      for (const auto& segment : seal.at("segments").at(name)) {
        from = until;
        until += segment.at("bytes").get<std::uint64_t>();
        end = utc_text(segment.at("until_unix_ns").get<std::int64_t>());
        if (at < until) break;
      }
      const auto found = altered_by(name, turned);
      ASSERT_EQ(found.size(), 1U) << name << ", byte " << at;
      EXPECT_TRUE(found[0].starts_with(std::string(name) + " is not as it was recorded from ")) << found[0];
      EXPECT_TRUE(found[0].ends_with(" to " + end + " (from byte " + std::to_string(from) + " on)")) << found[0];
    }
  }
}

// Its writer goes on when the run is closed: what came before is sealed, what comes later is said to be outside.
TEST_F(RunSealTest, EventsAreSealedAsFarAsTheyWereWhenTheRunWasClosed) {
  const std::string before = "{\"event\":\"script\",\"monotonic_ns\":5}\n",
                    later = "{\"event\":\"ended\",\"monotonic_ns\":6}\n";
  VirtualRobot robot;
  record(robot, path("run"), 1'000,
         [&](std::uint64_t tick) { EXPECT_TRUE(tick != 100 || replace_file(file("events.jsonl"), before)); });
  ASSERT_TRUE(replace_file(file("events.jsonl"), before + later));
  const auto checked = check_run_seal(RunFolder(path("run")));
  ASSERT_TRUE(checked) << checked.error();
  EXPECT_EQ(checked->altered, std::vector<std::string>{});
  EXPECT_EQ(checked->events_behind, later.size());
  const auto events = read_run_events(RunFolder(path("run")));
  ASSERT_EQ(events.size(), 2U);
  EXPECT_TRUE(events[0].is_sealed);
  EXPECT_FALSE(events[1].is_sealed);
  std::string forged = before;
  forged[before.size() - 3] = '4';
  EXPECT_EQ(altered_by("events.jsonl", forged + later).size(), 1U);
  EXPECT_EQ(altered_by("events.jsonl", before.substr(1)).size(), 1U);
}

TEST_F(RunSealTest, WhatIsCutAddedOrExchangedIsFound) {
  record_run();
  for (const char* const name : kGrownFiles) {
    const std::string content = read_file(file(name)).value();
    EXPECT_EQ(altered_by(name, content + "x"),
              std::vector<std::string>{std::string(name) + " has 1 bytes that were not recorded"});
    EXPECT_EQ(altered_by(name, content.substr(0, content.size() - 1)).size(), 1U);
    EXPECT_EQ(altered_by(name, content.substr(0, 9) + "x" + content.substr(9)).size(), 1U);
    EXPECT_EQ(altered_by(name, "").size(), 1U);
  }
  for (const char* const name : {"manifest.json", "config.yaml"})
    EXPECT_EQ(altered_by(name, read_file(file(name)).value() + "\n"),
              std::vector<std::string>{std::string(name) + " is not the file that was recorded"});
  for (const char* const name : {"ticks.mcap", "manifest.json"}) {
    std::filesystem::rename(file(name), path("aside"));
    EXPECT_EQ(altered().size(), 1U) << name;
    ASSERT_EQ(mkfifo(file(name).c_str(), 0600), 0);
    EXPECT_EQ(altered().size(), 1U) << name;
    std::filesystem::remove(file(name));
    std::filesystem::rename(path("aside"), file(name));
  }
  EXPECT_EQ(altered(), std::vector<std::string>{});
}

// Goal: a run that an earlier version sealed is judged as ever. Method: its frames lie in can.log, and so says the
// seal.
TEST_F(RunSealTest, TheFramesOfAnEarlierVersionAreSealedByTheirName) {
  record_run();
  std::string seal = read_file(file("seal.json")).value();
  seal.replace(seal.find("can.log.zst"), 11, "can.log");
  std::filesystem::rename(file("can.log.zst"), file("can.log"));
  ASSERT_TRUE(replace_file(file("seal.json"), seal));
  EXPECT_EQ(altered(), std::vector<std::string>{});
  EXPECT_EQ(altered_by("can.log", "x" + read_file(file("can.log")).value().substr(1)).size(), 1U);
}

// A seal that leads out of the folder, or that no recorder wrote, is none.
TEST_F(RunSealTest, AStrangersSealIsRefused) {
  record_run();
  const auto seal = nlohmann::ordered_json::parse(read_file(file("seal.json")).value());
  const auto refused = [&](const auto& change) {
    auto json = seal;
    change(json);
    const auto found = altered_by("seal.json", json.dump(2) + "\n");
    return found.size() == 1 && found[0].starts_with("seal.json is no seal");
  };
  EXPECT_TRUE(refused([](auto& json) { json["files"]["../../etc/passwd"] = "0"; }));
  EXPECT_TRUE(refused([](auto& json) { json["files"]["images/../manifest.json"] = "0"; }));
  EXPECT_TRUE(refused([](auto& json) { json["files"]["manifest.json"] = 1; }));
  EXPECT_TRUE(refused([](auto& json) { json["segments"].erase("can.log.zst"); }));
  EXPECT_TRUE(refused([](auto& json) { json["segments"]["can.log.zst"][0]["bytes"] = -1.5; }));
  EXPECT_TRUE(refused([](auto& json) { json["segments"]["../x"] = nlohmann::ordered_json::array(); }));
  EXPECT_TRUE(refused([](auto& json) { json["schema"] = "takt.run_seal/0"; }));
  EXPECT_TRUE(refused([](auto& json) { json["more"] = 1; }));
  EXPECT_TRUE(refused([](auto& json) { json = nlohmann::ordered_json::array(); }));
  EXPECT_EQ(altered_by("seal.json", "not JSON").size(), 1U);
}

TEST_F(RunSealTest, ARunThatWasNotClosedIsSealedUpToItsLastMinute) {
  VirtualRobot robot;
  const RunFolder folder = RunFolder::create(path("run")).value();
  {
    auto recorder = Recorder::start(folder, robot.manifest(), demo_robot()).value();
    auto stream = RecordStream::attach(robot.rings(), demo_robot().joints.size()).value();
    for (int i = 0; i < 3'300; ++i) {  // 66 s
      robot.run(20);
      stream.drain(recorder->sink(), false);
      recorder->flush_if_due(robot.latest().header.now);
    }
  }
  const auto checked = check_run_seal(folder);
  ASSERT_TRUE(checked) << checked.error();
  EXPECT_FALSE(checked->closed);
  EXPECT_EQ(checked->altered, std::vector<std::string>{});
  EXPECT_GE(checked->segments, 12U);
  const std::string content = read_file(file("can.log.zst")).value();
  EXPECT_EQ(altered_by("can.log.zst", "x" + content.substr(1)).size(), 1U);
}

TEST(SegmentSeal, FollowsAFileThatWasCutBack) {
  char name[] = "/tmp/takt-segment.XXXXXX";
  ::close(::mkstemp(name));
  ASSERT_TRUE(replace_file(name, "onetwo"));
  SegmentSeal seal;
  seal.add(std::as_bytes(std::span(std::string_view("one"))));
  seal.close(1);
  seal.add(std::as_bytes(std::span(std::string_view("two, and what the disk did not take"))));
  seal.cut_back(name, 6);
  seal.add(std::as_bytes(std::span(std::string_view("three"))));
  seal.close(2);
  seal.close(3);
  ASSERT_EQ(seal.closed().size(), 2U) << "nothing is no segment";
  EXPECT_EQ(seal.closed()[0].sha256, config::sha256_hex("one"));
  EXPECT_EQ(seal.closed()[1].sha256, config::sha256_hex("twothree"));
  EXPECT_EQ(seal.closed()[1].bytes, 8U);
  std::filesystem::remove(name);
}

}  // namespace
}  // namespace takt::monitor
