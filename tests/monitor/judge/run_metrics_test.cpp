// SPDX-License-Identifier: Apache-2.0
// Goal: the review's numbers are what the recorded ticks say. Method: the recorded demo, whose two stalls are known,
// against counts made here straight from the ticks.
#include "monitor/judge/run_metrics.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <numeric>

#include "evidence/review/report/report_text.hpp"
#include "evidence/review/run_review.hpp"
#include "monitor/judge/metrics_collector.hpp"
#include "monitor/record/mcap_writer.hpp"
#include "monitor/record/run_events.hpp"
#include "monitor/record/word_log.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class RunMetricsTest : public takt::test::TemporaryFolder {
 protected:
  const RecordedRun run_ = record_demo(path("run"));
};

TEST_F(RunMetricsTest, CountsAreTheTicksOwn) {
  const auto metrics = metrics_of(run_);
  ASSERT_TRUE(metrics) << metrics.error();
  std::uint64_t relied = 0, missed = 0, accepted = 0;
  std::int64_t oldest = 0;
  (void)scan_run(run_, {.tick =
                            [&](const RecordedTick& tick) {
                              const TickRecordHeader& header = tick.record.header;
                              accepted += header.seats[Seat::policy].arrival == Arrival::accepted ? 1U : 0U;
                              if (header.previous_mode != Mode::tracking && header.previous_mode != Mode::degraded)
                                return;
                              ++relied;
                              missed += is_usable(header.seats[Seat::policy].freshness) ? 0U : 1U;
                              oldest = std::max(oldest, header.age.total().ns);
                            },
                        .command = {},
                        .keyframe = {},
                        .loss = {}});
  EXPECT_EQ(metrics->ticks, kDemoTicks);
  EXPECT_EQ(metrics->relied_ticks, relied);
  EXPECT_EQ(metrics->misses_per_tick.misses, missed);
  EXPECT_EQ(metrics->misses_per_tick.verdict, Verdict::violated);
  EXPECT_EQ(metrics->arrivals[static_cast<std::size_t>(Arrival::accepted)], accepted);
  EXPECT_EQ(metrics->age_per_tick.back().max, static_cast<double>(oldest));
  EXPECT_EQ(std::accumulate(metrics->ticks_in_mode.begin(), metrics->ticks_in_mode.end(), std::uint64_t{0}),
            kDemoTicks);
}

// Goal: the evidence says for how long nothing would have taken over. Method: records of a robot whose fallback
// policy attached, fell silent while tracking, and one of standby, where it is not needed.
// Goal: no word in a record makes ticks of a moving robot count as left out of quiet standby. Method: nine ticks
// missing between two of a mode, with a loss that says so.
TEST(MetricsCollector, OnlyStandbyIsLeftOutAsQuiet) {
  for (const Mode mode : {Mode::standby, Mode::tracking}) {
    RunMetrics metrics;
    MetricsCollector collector(metrics);
    auto record = std::make_unique<TickRecord>();
    record->header.mode = record->header.previous_mode = mode;
    for (const std::uint64_t tick : {1U, 2U, 12U}) {
      record->header.tick = tick;
      collector.tick(*record);
    }
    collector.loss({"tick", std::string(kStoodBy), 9, 2, 12});
    collector.finish(0.01, 0.95);
    EXPECT_EQ(metrics.missing_ticks, mode == Mode::standby ? 0U : 9U);
    EXPECT_EQ(metrics.stood_by_ticks, 9U);
  }
}

TEST(MetricsCollector, CountsTicksThatReliedOnAPolicyWithoutAFreshFallback) {
  RunMetrics metrics;
  MetricsCollector collector(metrics);
  TickRecord record;
  const auto tick = [&](Mode mode, std::uint8_t session, Freshness freshness) {
    ++record.header.tick;
    record.header.mode = record.header.previous_mode = mode;
    record.header.seats[Seat::fallback].session = session;
    record.header.seats[Seat::fallback].freshness = freshness;
    collector.tick(record);
  };
  tick(Mode::tracking, 0, Freshness::missing);  // the robot has none
  tick(Mode::tracking, 1, Freshness::fresh);
  tick(Mode::standby, 1, Freshness::stale);
  EXPECT_EQ(metrics.ticks_without_fallback, 0U);
  tick(Mode::tracking, 1, Freshness::stale);
  tick(Mode::degraded, 1, Freshness::missing);
  EXPECT_EQ(metrics.ticks_without_fallback, 2U);
}

// The policy stalls twice: hundreds of ticks miss, but they are the fault of two commands.
TEST_F(RunMetricsTest, AStallIsOneMissedCommand) {
  const auto metrics = metrics_of(run_);
  ASSERT_TRUE(metrics);
  EXPECT_EQ(metrics->misses_per_command.misses, 2U);
  EXPECT_GT(metrics->misses_per_tick.misses, 500U);
  // The virtual policy's stages: camera 25 ms before, start after 2 ms, 7 ms of inference, used 3 ms later.
  EXPECT_EQ(metrics->age_per_command[0].p50, 25e6);
  EXPECT_EQ(metrics->age_per_command[1].p50, 2e6);
  EXPECT_EQ(metrics->age_per_command[2].p50, 7e6);
  EXPECT_EQ(metrics->age_per_command[3].p50, 3e6);
  EXPECT_EQ(metrics->age_per_command[5].p50, 37e6);
}

TEST_F(RunMetricsTest, AMarkIsListedWithItsTick) {
  const auto metrics = write_metrics(run_);
  ASSERT_TRUE(metrics);
  ASSERT_EQ(metrics->marks.size(), 1U);
  EXPECT_EQ(metrics->marks[0].tick, kDemoMark);
  std::ifstream file(run_.folder.metrics());
  EXPECT_EQ(nlohmann::json::parse(file).at("marks").at(0).at("tick"), kDemoMark);
  EXPECT_NE(evidence::report_text(*metrics, run_)
                .find(fmt::format("marks         1\n  tick {:>9}      +0.699 s\n", kDemoMark)),
            std::string::npos)
      << evidence::report_text(*metrics, run_);
}

// Goal: what an operator said of a mark stands with it, and another's mark with none. Method: the answers of the
// executive, as the recorder keeps them.
TEST_F(RunMetricsTest, AMarkHasTheTextThatItsOperatorGave) {
  std::filesystem::remove(run_.folder.seal());  // so that lines may be added
  std::ofstream events(run_.folder.path() + "/" + std::string(kEventsFile), std::ios::app);
  for (const std::string& answer :
       {std::string("marked tick 7: another's"), std::string("marked tick 700: it slips: left"),
        std::string("marked tick 70000000000000000000000: no tick")})
    events << event_line(kOperatorEvent, MonoTime{1}, {{"action", "mark"}, {"done", true}, {"what", answer}});
  events.close();
  const auto metrics = write_metrics(run_);
  ASSERT_TRUE(metrics);
  ASSERT_EQ(metrics->marks.size(), 1U);
  EXPECT_EQ(metrics->marks[0].text, "it slips: left");
  std::ifstream file(run_.folder.metrics());
  EXPECT_EQ(nlohmann::json::parse(file).at("marks").at(0).at("text"), "it slips: left");
  EXPECT_NE(evidence::report_text(*metrics, run_).find("+0.699 s  it slips: left\n"), std::string::npos);
}

// Goal: a run in which the robot was never armed says so, and why, before anything else. Method: metrics of a standby
// alone, with and without a refused request, and of a run that tracked.
TEST_F(RunMetricsTest, ARunThatWasNeverArmedSaysWhy) {
  RunMetrics metrics;
  metrics.ticks = metrics.ticks_in_mode[static_cast<std::size_t>(Mode::standby)] = 10;
  EXPECT_NE(evidence::report_text(metrics, run_).find("stops         none: it was never armed\n"), std::string::npos);
  NotedRequest refused;
  refused.action = "arm";
  refused.answer = "no camera";
  metrics.requests = {refused, refused};
  EXPECT_NE(
      evidence::report_text(metrics, run_).find("stops         none: it was never armed, refused by: no camera\n"),
      std::string::npos);
  metrics.ticks = 11;
  EXPECT_NE(evidence::report_text(metrics, run_).find("stops         none\n"), std::string::npos);
}

// Goal: a request that was refused again and again takes one line of the report. Method: three refusals by one process,
// one by another, and an arming that was granted.
TEST_F(RunMetricsTest, ARequestThatIsRepeatedIsOneLine) {
  auto metrics = metrics_of(run_);
  ASSERT_TRUE(metrics);
  const NotedRequest refused{metrics->start, "arm", "takt", "no fresh command", 7, 1000, false};
  NotedRequest another = refused, granted = refused;
  another.pid = 8;
  granted.done = true;
  metrics->requests = {refused, refused, refused, another, granted};
  EXPECT_NE(evidence::report_text(*metrics, run_)
                .find("requests      5\n"
                      "      +0.000 s  arm by pid 7 (takt), user 1000: refused: no fresh command (3 times)\n"
                      "      +0.000 s  arm by pid 8 (takt), user 1000: refused: no fresh command\n"
                      "      +0.000 s  arm by pid 7 (takt), user 1000\n"),
            std::string::npos)
      << evidence::report_text(*metrics, run_);
}

TEST_F(RunMetricsTest, MetricsFileAndReportSayTheSame) {
  const auto metrics = write_metrics(run_);
  ASSERT_TRUE(metrics);
  std::ifstream file(run_.folder.metrics());
  const auto json = nlohmann::json::parse(file);
  EXPECT_EQ(json.at("schema"), "takt.metrics/1");
  EXPECT_EQ(json.at("deadline_misses").at("per_tick").at("misses"), metrics->misses_per_tick.misses);
  EXPECT_EQ(json.at("age_ns").at("per_command").at("total").at("p50"), 37e6);
  EXPECT_EQ(json.at("degraded_by_p95"), true);
  const std::string text = evidence::report_text(*metrics, run_);
  EXPECT_NE(text.find("command_lost"), std::string::npos) << text;
  EXPECT_NE(text.find("violated"), std::string::npos) << text;
}

// Per tick is time, per command is events: one sentence says what the two verdicts mean together.
TEST(ContractText, SaysWhatTheTwoVerdictsMeanTogether) {
  const auto text = [](Verdict by_command, Verdict by_time) {
    RunMetrics metrics;
    metrics.misses_per_command = {.misses = 2, .count = 435, .verdict = by_command};
    metrics.misses_per_tick = {.misses = 801, .count = 9694, .rate = 801.0 / 9694, .verdict = by_time};
    const std::string all = evidence::contract_text(metrics);
    const std::string facts = "2 of 435 commands missed, and 8.26 % of the time there was no usable one: ";
    return all.starts_with(facts) ? all.substr(facts.size()) : all;
  };
  using enum Verdict;
  EXPECT_EQ(text(held, held), "the contract was held");
  EXPECT_EQ(text(held, violated), "few losses, but long ones; held by commands, violated by time");
  EXPECT_EQ(text(violated, held), "many losses, but short ones; violated by commands, held by time");
  EXPECT_EQ(text(violated, violated), "the contract was violated");
  EXPECT_EQ(text(undecided, violated), "too few commands to decide; by time the contract was violated");
  EXPECT_EQ(evidence::contract_text({}), "");
}

// One pass must say what two passes say, losses and damage included.
TEST_F(RunMetricsTest, AReviewIsTheMetricsAndTheFaults) {
  const RecordedRun torn = altered_copy(
      run_, path("torn"), [](TickRecord&) {}, [](RecordedCommand&) {}, [](std::uint64_t tick) { return tick < 2'000; });
  for (const RecordedRun* run : {&run_, &torn}) {
    auto review = evidence::review_of(*run);
    ASSERT_TRUE(review) << review.error();
    for (incident::Incident& incident : review->metrics.incidents)
      incident.counterfactual.clear();  // replay's word alone
    EXPECT_EQ(to_json(review->metrics, *run), to_json(*metrics_of(*run), *run));
    EXPECT_EQ(to_json(review->faults), to_json(*classify_run(*run)));
  }
  const std::string text = evidence::report_text(*metrics_of(torn), torn);
  EXPECT_NE(text.find("2001 of 4000 recorded ticks cannot be read"), std::string::npos) << text;
}

// Goal: "real-time yes" does not hide what the machine lacks. Method: an executive's steps with one that failed.
TEST_F(RunMetricsTest, WhatTheMachineLacksStandsBesideItsRealTime) {
  RecordedRun lacking = run_;
  lacking.manifest.executive["realtime"] = true;
  EXPECT_NE(evidence::report_text(*metrics_of(lacking), lacking).find("real-time     yes\n"), std::string::npos);
  lacking.manifest.executive["realtime_steps"] = {
      {{"name", "sched_fifo"}, {"ok", true}, {"essential", true}, {"detail", "priority 80"}},
      {{"name", "kernel"}, {"ok", false}, {"essential", false}, {"detail", "not PREEMPT_RT"}}};
  EXPECT_NE(
      evidence::report_text(*metrics_of(lacking), lacking).find("real-time     yes; but kernel: not PREEMPT_RT\n"),
      std::string::npos);
}

TEST_F(RunMetricsTest, WhatIsNotWhatItsTopicSaysIsCounted) {
  RunFolder folder = *RunFolder::create(path("odd"));
  for (const char* file : {"config.yaml", "manifest.json"})
    std::filesystem::copy_file(run_.folder.path() + "/" + file, folder.path() + "/" + file);
  auto writer = McapWriter::create(folder.ticks(), 1U << 20U, run_topics(), {});
  ASSERT_TRUE(writer);
  const Bytes nonsense(16);
  CdrWriter message;
  const auto first = [&](const RecordedTick& tick) {
    if (tick.record.header.tick == 1) encode_tick(tick.record, tick.crc, message);
  };
  ASSERT_TRUE(scan_run(run_, {.tick = first, .command = {}, .keyframe = {}, .loss = {}}));
  for (const Bytes& bytes : {message.bytes(), nonsense})
    writer->write(static_cast<std::uint16_t>(Topic::tick), 1, bytes);
  writer->finish();
  const RecordedRun odd = *open_run(folder.path());
  const auto metrics = metrics_of(odd);
  ASSERT_TRUE(metrics);
  EXPECT_EQ(metrics->ticks, 1U);
  EXPECT_EQ(metrics->scan.undecodable, 1U);
  const std::string text = evidence::report_text(*metrics, odd);
  EXPECT_NE(text.find("not what their topic says, skipped: 1"), std::string::npos) << text;
}

}  // namespace
}  // namespace takt::monitor
