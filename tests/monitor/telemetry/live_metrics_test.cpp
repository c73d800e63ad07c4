// SPDX-License-Identifier: Apache-2.0
// Goal: the running counts say what the finished run's metrics say. Method: a virtual robot whose policy stalls is read
// from its rings by both LiveMetrics and the recorded run's own collector; histograms are fed values on their bounds.
// An alert on a counter's increase sees no first value: every loss that can occur is there from the start, as 0.
#include "monitor/telemetry/live_metrics.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "monitor/judge/metrics_collector.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {
namespace {

TEST(Histogram, ABoundBelongsToItsOwnBucket) {
  Histogram histogram({milliseconds(1), milliseconds(10)});
  for (const Duration value : {milliseconds(1), milliseconds(1) + Duration{1}, milliseconds(10), milliseconds(11)})
    histogram.observe(value);
  EXPECT_EQ(histogram.counts, (std::vector<std::uint64_t>{1, 2, 1}));
  EXPECT_EQ(histogram.count, 4U);
  EXPECT_EQ(histogram.sum, milliseconds(23) + Duration{1});
}

TEST(LiveMetrics, TheContractsLimitIsABound) {
  config::RobotConfig robot = demo_robot();
  robot.freshness.max_age = milliseconds(137);
  const auto& bounds = LiveMetrics(robot).age.bounds;
  EXPECT_TRUE(std::ranges::is_sorted(bounds));
  EXPECT_EQ(std::ranges::count(bounds, milliseconds(137)), 1);
  robot.freshness.max_age = milliseconds(150);
  EXPECT_EQ(std::ranges::count(LiveMetrics(robot).age.bounds, milliseconds(150)), 1);
}

TEST(LiveMetrics, CountWhatTheRunsMetricsCount) {
  LiveMetrics live(demo_robot());
  live.begin("run");
  RunMetrics metrics;
  MetricsCollector collector(metrics);
  VirtualRobot robot;
  auto stream = RecordStream::attach(robot.rings(), demo_robot().joints.size());
  ASSERT_TRUE(stream.has_value());
  const RecordSink sink{.command = [](const RecordedCommand&) {},
                        .tick =
                            [&](const TickRecord& record) {
                              live.tick(record);
                              collector.tick(record);
                            },
                        .keyframe = [](const RecordedKeyframe&) {},
                        .frame = [](const FrameRecord&) {},
                        .loss = [&](const Loss& loss) { live.loss(loss); }};
  for (int part = 0; part < 12; ++part) {
    robot.policy_is_frozen = part == 6;
    robot.run(250);
    stream->drain(sink, false);
  }
  stream->drain(sink, true);
  collector.finish(0.01, 0.95);

  EXPECT_EQ(live.ticks, metrics.ticks);
  EXPECT_EQ(live.relied_ticks, metrics.relied_ticks);
  EXPECT_GT(live.deadline_misses, 0U) << "the stall";
  EXPECT_EQ(live.deadline_misses, metrics.misses_per_tick.misses);
  EXPECT_EQ(live.arrivals, metrics.arrivals);
  EXPECT_EQ(live.overruns, metrics.overruns);
  EXPECT_EQ(live.skipped_periods, metrics.skipped_periods);
  EXPECT_EQ(live.lateness.count, metrics.ticks);
  std::uint64_t transitions = 0;
  for (const auto& [change, times] : live.transitions) transitions += times;
  EXPECT_EQ(transitions, metrics.transition_count);
  std::array<std::uint64_t, kInterventionCount> interventions{};
  for (const auto& joint : live.interventions)
    for (std::size_t kind = 0; kind < kInterventionCount; ++kind) interventions[kind] += joint[kind];
  EXPECT_EQ(interventions, metrics.interventions);
  const auto within = [&](const Histogram& histogram) {
    std::uint64_t count = 0;
    for (std::size_t i = 0; i < histogram.bounds.size() && histogram.bounds[i] <= demo_robot().freshness.max_age; ++i)
      count += histogram.counts[i];
    return count;
  };
  EXPECT_EQ(live.age.count - within(live.age) + (live.relied_ticks - live.age.count), live.deadline_misses)
      << "misses can be read off the histogram";
}

// A monitor that slept for longer than each ring is long.
TEST(LiveMetrics, EveryLossARingCanHaveIsCountedFromZero) {
  LiveMetrics live(demo_robot());
  const auto before = live.losses;
  for (const auto& [what, entries] : before) EXPECT_EQ(entries, 0U) << what.first << " " << what.second;
  live.begin("run");
  VirtualRobot robot;
  auto stream = RecordStream::attach(robot.rings(), demo_robot().joints.size());
  ASSERT_TRUE(stream.has_value());
  const RecordSink sink{.command = [](const RecordedCommand&) {},
                        .tick = [](const TickRecord&) {},
                        .keyframe = [](const RecordedKeyframe&) {},
                        .frame = [](const FrameRecord&) {},
                        .loss = [&](const Loss& loss) { live.loss(loss); }};
  for (int slept = 0; slept < 2; ++slept) {
    robot.run(10'000);
    stream->drain(sink, false);
  }
  EXPECT_GT(live.losses.at({"tick", "before_attach"}), 0U);
  EXPECT_GT(live.losses.at({"tick", "overwritten"}), 0U);
  live.recording_stopped(1);
  EXPECT_EQ(live.losses.size(), before.size()) << "a loss was born later";
}

TEST(LiveMetrics, UnrecordedTicksAreCountedOverEverySession) {
  LiveMetrics live(demo_robot());
  const auto unrecorded = [&] { return live.losses.at({"tick", "recording_stopped"}); };
  live.begin("first");
  live.recording_stopped(400);
  live.recording_stopped(450);
  EXPECT_EQ(unrecorded(), 450U);
  EXPECT_TRUE(live.running && !live.recording);
  live.end();
  live.begin("second");
  EXPECT_TRUE(live.running && live.recording);
  live.recording_stopped(7);
  EXPECT_EQ(unrecorded(), 457U);
}

}  // namespace
}  // namespace takt::monitor
