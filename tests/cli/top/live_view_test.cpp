// SPDX-License-Identifier: Apache-2.0
// Goal: what the view shows is what the rings said, and what the clock makes of it. Method: a virtual robot whose
// policy stalls is read through its real rings; its stages, rates and frames are known exactly.
#include "cli/top/live_view.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "drivers/protocol/bus_load.hpp"
#include "monitor/record/record_stream.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor::top {
namespace {

class LiveViewTest : public testing::Test {
 protected:
  LiveViewTest() { view_.begin(); }
  // Runs the robot and takes in what it published, as a viewer does.
  void run(std::uint64_t ticks) {
    for (std::uint64_t done = 0; done < ticks; done += 100) {
      robot_.run(100);
      stream_.drain(sink_, true);
    }
  }
  [[nodiscard]] MonoTime now() const { return robot_.latest().header.now; }
  [[nodiscard]] Picture picture() const { return view_.picture(now()); }

  VirtualRobot robot_;
  LiveView view_{demo_robot()};
  RecordStream stream_ = RecordStream::attach(robot_.rings(), demo_robot().joints.size()).value();
  RecordSink sink_{.command = [](const RecordedCommand&) {},
                   .tick = [this](const TickRecord& record) { view_.tick(record); },
                   .keyframe = [](const RecordedKeyframe&) {},
                   .frame = [this](const FrameRecord& frame) { view_.frame(frame); },
                   .loss = [this](const Loss& loss) { view_.loss(loss); }};
};

TEST_F(LiveViewTest, BeforeTheFirstTickThereIsNothing) {
  EXPECT_EQ(view_.picture(MonoTime{} + seconds(5)).link, Link::silent);
  view_.wait("nobody listens");
  const Picture picture = view_.picture(MonoTime{} + seconds(5));
  EXPECT_EQ(picture.link, Link::waiting);
  EXPECT_EQ(picture.why, "nobody listens");
  EXPECT_TRUE(picture.history.empty());
}

TEST_F(LiveViewTest, AgesAndStagesAreTheCommandsOwn) {
  run(2'000);
  const Picture shown = picture();
  EXPECT_EQ(shown.link, Link::live);
  EXPECT_EQ(shown.tick.mode, Mode::tracking);
  EXPECT_EQ(shown.entered_by, Cause::drives_enabled);
  // The virtual policy: camera 25 ms before, start after 2 ms, 7 ms of inference, used 3 ms later.
  EXPECT_EQ(shown.stages[0].p50, 25e6);
  EXPECT_EQ(shown.stages[1].p50, 2e6);
  EXPECT_EQ(shown.stages[2].p50, 7e6);
  EXPECT_EQ(shown.stages[3].p50, 3e6);
  EXPECT_GE(shown.age.p50, 37e6) << "37 ms at first use, older while it is held";
  EXPECT_LT(shown.age.max, 150e6);
  EXPECT_EQ(shown.tick.command_policy, VirtualRobot::kPolicyHash);
  EXPECT_EQ(shown.policy_rate, shown.planned_rate) << "every observation is answered";
}

TEST_F(LiveViewTest, AStallIsMissedSliceBySlice) {
  run(2'000);
  robot_.policy_is_frozen = true;
  run(500);
  const Picture shown = picture();
  EXPECT_EQ(shown.tick.mode, Mode::degraded);
  EXPECT_GT(shown.misses.misses, 200U);
  EXPECT_EQ(shown.misses.verdict, Verdict::violated);
  ASSERT_GE(shown.history.size(), 10U);
  EXPECT_TRUE(shown.history.back().missed);
  EXPECT_EQ(shown.history.back().mode, Mode::degraded);
  EXPECT_GT(shown.history.back().age, shown.max_age);
  EXPECT_FALSE(shown.history[shown.history.size() - 4].missed) << "before the stall";
  EXPECT_LT(shown.policy_rate, shown.planned_rate);
}

TEST_F(LiveViewTest, TimeThatPassesWithoutATickShows) {
  run(2'000);
  const std::size_t slices = picture().history.size();
  const Picture later = view_.picture(now() + seconds(3));
  EXPECT_EQ(later.link, Link::silent);
  EXPECT_EQ(later.since_tick, seconds(3));
  ASSERT_GE(later.history.size(), slices + 11);
  EXPECT_EQ(later.history.back().ticks, 0U);
  EXPECT_EQ(later.buses[0].load, 0);
}

TEST_F(LiveViewTest, HistoryIsBounded) {
  run(70'000);
  EXPECT_EQ(picture().history.size(), kSlices);
  EXPECT_EQ(view_.picture(now() + seconds(10'000)).history.size(), kSlices);
}

TEST_F(LiveViewTest, QuantilesAreOverTheWindowOnly) {
  run(2'000);
  robot_.policy_is_frozen = true;
  run(400);
  robot_.policy_is_frozen = false;
  run(3'000);
  EXPECT_GT(picture().age.max, 150e6);
  run(10'000);
  EXPECT_LT(picture().age.max, 150e6);
  EXPECT_EQ(picture().age.count, 10'001U);
}

TEST_F(LiveViewTest, AMarkShowsInItsSlice) {
  robot_.mark_at = 1'500;
  run(2'000);
  const auto history = picture().history;
  EXPECT_EQ(std::ranges::count_if(history, [](const Slice& slice) { return slice.marked; }), 1);
}

TEST_F(LiveViewTest, BusLoadIsWhatItsFramesTake) {
  run(2'000);
  const Picture shown = picture();
  ASSERT_EQ(shown.buses.size(), 2U);
  // One frame of two bytes per millisecond on the first bus, none on the second.
  EXPECT_NEAR(shown.buses[0].load, 1000.0 * drivers::most_frame_bits(2, false) / 1e6, 1e-9);
  EXPECT_EQ(shown.buses[1].load, 0);
  EXPECT_EQ(shown.buses[0].planned, drivers::check_bus_load(demo_robot()).value()[0].load);
}

TEST_F(LiveViewTest, AFrameOfNoBusOfOursIsIgnored) {
  view_.frame({.stamp = MonoTime{} + seconds(1), .bus = 7, .length = 8});
  EXPECT_EQ(view_.picture(MonoTime{} + seconds(1) + milliseconds(100)).buses[0].load, 0);
}

TEST_F(LiveViewTest, ANewSessionStartsAnewButKeepsTheHistory) {
  run(2'000);
  const std::size_t slices = picture().history.size();
  view_.wait("the executive ended");
  view_.begin();
  const Picture shown = picture();
  EXPECT_EQ(shown.ticks, 0U);
  EXPECT_EQ(shown.age.count, 0U);
  EXPECT_EQ(shown.tick.command_policy, 0U);
  EXPECT_GE(shown.history.size(), slices);
}

TEST_F(LiveViewTest, OnlyWhatThisReaderMissedCountsAsLost) {
  view_.loss({"tick", "before_attach", 100, 0, 101});
  view_.loss({"frame", "overwritten", 7, 0, 0});
  EXPECT_EQ(picture().lost_ticks, 0U);
  view_.loss({"tick", "overwritten", 30, 101, 132});
  EXPECT_EQ(picture().lost_ticks, 30U);
}

}  // namespace
}  // namespace takt::monitor::top
