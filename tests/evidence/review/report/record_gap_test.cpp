// SPDX-License-Identifier: Apache-2.0
// Goal: the report says "none" of a whole record only; where the record ends before the run it says so, in the terminal
// and in metrics.json, and tells the stop that other files know of. Method: the recorded demo, which stops once, with
// its ticks cut at 20 places; a recording that its disk stopped; a recorder that was killed; a gap in between.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "evidence/review/report/report_text.hpp"
#include "evidence/review/run_review.hpp"
#include "monitor/record/run_events.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

namespace fs = std::filesystem;

class RecordGapTest : public test::TemporaryFolder {
 protected:
  // Another copy of the demo.
  RunFolder copy() {
    const std::string to = path("copy" + std::to_string(++copies_));
    fs::copy(run_.folder.path(), to, fs::copy_options::recursive);
    return RunFolder(to);
  }
  static std::string told(const RecordedRun& run, const evidence::RunReview& review) {
    return evidence::report_text(review.metrics, run) + evidence::faults_of_record(review.metrics, review.faults);
  }
  // Lines of a report that deny something.
  static std::vector<std::string> denials(const std::string& text) {
    std::vector<std::string> found;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
      if (line.ends_with(" none") || line.find(" none;") != std::string::npos ||
          line.find(" none (joint-ticks)") != std::string::npos || line.find(": none") != std::string::npos)
        found.push_back(line);
    return found;
  }
  static void expect_gap(const RecordedRun& run, const evidence::RunReview& review, const std::string& why) {
    EXPECT_NE(review.metrics.record_gap.find(why), std::string::npos) << review.metrics.record_gap;
    const std::string text = told(run, review);
    EXPECT_TRUE(denials(text).empty()) << denials(text).front() << "\n" << text;
    EXPECT_NE(text.find("\nUNKNOWN       "), std::string::npos) << text;
    const auto json = to_json(review.metrics, run);
    EXPECT_EQ(json.at("record_gap"), review.metrics.record_gap);
    for (const char* per : {"per_tick", "per_command"})
      EXPECT_NE(json.at("deadline_misses").at(per).at("verdict"), "held");
  }

  const RecordedRun run_ = record_demo(path("run"));
  int copies_ = 0;
};

TEST_F(RecordGapTest, OfAWholeRecordWhatIsNotThereIsNone) {
  const auto review = evidence::review_of(run_);
  ASSERT_TRUE(review);
  EXPECT_EQ(review->metrics.record_gap, "");
  EXPECT_TRUE(to_json(review->metrics, run_).at("record_gap").is_null());
  const std::string text = told(run_, *review);
  EXPECT_NE(text.find("losses        none\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("UNKNOWN"), std::string::npos) << text;
}

TEST_F(RecordGapTest, TicksCutAnywhereDenyNothingAndTheStopIsTold) {
  const auto whole = evidence::review_of(run_)->metrics.incidents;
  ASSERT_EQ(whole.size(), 1U);
  const auto size = fs::file_size(run_.folder.ticks());
  constexpr std::uintmax_t kPlaces = 20;
  for (std::uintmax_t place = 1; place <= kPlaces; ++place) {
    SCOPED_TRACE(place);
    const RunFolder folder = copy();
    fs::resize_file(folder.ticks(), size * place / (kPlaces + 1));
    const auto run = open_run(folder.path());
    ASSERT_TRUE(run);
    const auto review = evidence::review_of(*run);
    ASSERT_TRUE(review) << review.error();
    expect_gap(*run, *review, "ticks.mcap is cut off");
    ASSERT_EQ(review->metrics.incidents.size(), 1U);
    EXPECT_EQ(review->metrics.incidents[0].sentence, whole[0].sentence);
    const bool is_beyond = review->metrics.last_tick < whole[0].tick;
    const auto origin = review->metrics.stop_origins.find(whole[0].tick);
    EXPECT_EQ(origin != review->metrics.stop_origins.end() && origin->second.told_by == "transitions.jsonl", is_beyond);
    fs::remove_all(folder.path());
  }
}

// What lies beside a cut record is a stranger's: a reader takes so much of it and no more.
TEST_F(RecordGapTest, TransitionsAndEventsInMassesAreBounded) {
  const RunFolder cut = copy();
  fs::resize_file(cut.ticks(), fs::file_size(cut.ticks()) / 2);
  std::ofstream transitions(cut.transitions()), events(cut.path() + "/events.jsonl");
  for (int i = 0; i < 20'000; ++i) {
    transitions << R"({"tick":)" << 100'000 + i << R"(,"monotonic_ns":)" << 100'000 + i
                << R"(,"from":"tracking","to":"degraded","cause":"contract_violated","detail":"","incident":""})"
                << '\n';
    events << R"({"event":"fault","monotonic_ns":)" << 1 + i << R"(,"what":"elbow: silent"})" << '\n';
  }
  transitions.close();
  events.close();
  EXPECT_EQ(read_run_events(cut).size(), kMostRunEvents);
  const auto run = open_run(cut.path());
  ASSERT_TRUE(run) << run.error();
  const auto review = evidence::review_of(*run);
  ASSERT_TRUE(review) << review.error();
  EXPECT_GT(review->metrics.transitions.size(), 9'000U);
  EXPECT_LT(review->metrics.transitions.size(), 11'000U);
}

// Nothing reached transitions.jsonl either: the executive's log knows.
TEST_F(RecordGapTest, AFullDiskIsNoEndOfTheRun) {
  VirtualRobot robot;
  const auto folder = RunFolder::create(path("full"));
  auto recorder = Recorder::start(*folder, robot.manifest(), demo_robot(), 200'000);
  ASSERT_TRUE(recorder);
  auto stream = RecordStream::attach(robot.rings(), demo_robot().joints.size());
  for (int i = 0; i < 200; ++i) {
    robot.run(20);
    stream->drain((*recorder)->sink(), false);
    (*recorder)->flush_if_due(robot.latest().header.now);
  }
  ASSERT_TRUE((*recorder)->finish(robot.latest().header.now, "test over"));
  ASSERT_FALSE((*recorder)->stop_reason().empty());
  const std::uint64_t beyond = (*recorder)->manifest().last_tick + 50;
  fs::create_directory(folder->path() + "/logs");
  std::ofstream(folder->path() + "/logs/takt-executive.log")
      << "2023-11-14T22:30:07.000Z takt-executive info: standby -> arming: operator_arm (tick 101, age 0.0 ms, misses "
         "0 of 0)\n"
      << "2023-11-14T22:30:09.000Z takt-executive warning: tracking -> damped_stop: recording_lost (tick " << beyond
      << ", age 12.0 ms, misses 0 of 900): stop at tick " << beyond
      << ": recording_lost: nothing records; done: the robot is damped; clears with: a recorder\n";
  const auto run = open_run(folder->path());
  const auto review = evidence::review_of(*run);
  ASSERT_TRUE(review);
  expect_gap(*run, *review, "recording stopped: ");
  ASSERT_EQ(review->metrics.incidents.size(), 1U);
  EXPECT_EQ(review->metrics.incidents[0].tick, beyond);
  EXPECT_EQ(review->metrics.incidents[0].cause, Cause::recording_lost);
  EXPECT_EQ(review->metrics.stop_origins.at(beyond).told_by, "logs/takt-executive.log");
  EXPECT_NE(told(*run, *review).find("STOPPED       "), std::string::npos) << told(*run, *review);
}

TEST_F(RecordGapTest, ARunThatIsStillRecordedIsToldFromOneThatWasCut) {
  VirtualRobot robot;
  const auto folder = RunFolder::create(path("going on"));
  auto recorder = Recorder::start(*folder, robot.manifest(), demo_robot());
  ASSERT_TRUE(recorder);
  auto stream = RecordStream::attach(robot.rings(), demo_robot().joints.size());
  robot.run(20);
  stream->drain((*recorder)->sink(), false);
  (*recorder)->flush_if_due(robot.latest().header.now);
  const auto gap = [&] { return evidence::review_of(*open_run(folder->path()))->metrics.record_gap; };
  EXPECT_NE(gap().find("): the run is still recorded"), std::string::npos) << gap();
  recorder->reset();
  EXPECT_NE(gap().find("the recorder was ended before it closed the run"), std::string::npos) << gap();
}

TEST_F(RecordGapTest, AKilledRecorderIsNamed) {
  const RunFolder folder = copy();
  RecordedRun run = *open_run(folder.path());
  run.manifest.complete = false;
  run.manifest.ended_at = {};
  ASSERT_TRUE(folder.write_manifest(run.manifest));
  fs::resize_file(folder.ticks(), fs::file_size(folder.ticks()) / 2);
  fs::remove(folder.seal());
  std::ofstream events(folder.path() + "/events.jsonl");
  for (const char* how : {"was killed by SIGKILL", "exited with 0"})  // the second was started in its place
    events << R"({"event":"ended","process":"takt-monitor","monotonic_ns":)" << run.manifest.started_at.ns + 5
           << R"(,"how":")" << how << "\"}\n";
  events.close();
  const auto review = evidence::review_of(run);
  ASSERT_TRUE(review);
  expect_gap(run, *review, "the recorder was ended before it closed the run (takt-monitor was killed by SIGKILL)");
}

TEST_F(RecordGapTest, AHoleInBetweenMayHideAStop) {
  const auto without = [](std::uint64_t tick) { return tick < 1'000 || tick > 1'200; };
  const RecordedRun run = altered_copy(
      run_, path("hole"), [](TickRecord&) {}, [](RecordedCommand&) {}, without);
  const auto review = evidence::review_of(run);
  ASSERT_TRUE(review);
  expect_gap(run, *review, "the record has holes: ");
}

// As a recorder that was restarted begins: in the middle.
TEST_F(RecordGapTest, ARecordThatBeginsLateMayLackAStop) {
  RecordedRun run = altered_copy(
      run_, path("late"), [](TickRecord&) {}, [](RecordedCommand&) {}, [](std::uint64_t tick) { return tick > 3'900; });
  run.manifest.ticks = 100;
  const auto review = evidence::review_of(run);
  ASSERT_TRUE(review);
  expect_gap(run, *review, "the record has holes: when it began, at tick 3901, the robot was in damped_stop");
}

// An executive that was killed said nothing more: a robot that moved then did not come to rest on record.
TEST_F(RecordGapTest, AnExecutiveThatEndsWhileTheRobotMovesIsNoEnd) {
  const RecordedRun moving = altered_copy(
      run_, path("moving"), [](TickRecord&) {}, [](RecordedCommand&) {},
      [](std::uint64_t tick) { return tick < 1'000; });
  RunManifest manifest = moving.manifest;
  manifest.ticks = manifest.last_tick = 999;
  manifest.ended_because = "executive ended";
  const RecordedRun run{moving.folder, manifest, moving.robot};
  const auto review = evidence::review_of(run);
  ASSERT_TRUE(review);
  expect_gap(run, *review, "the executive ended while the robot was in tracking");
}

}  // namespace
}  // namespace takt::monitor
