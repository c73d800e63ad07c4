// SPDX-License-Identifier: Apache-2.0
// Goal: a command's trace says when each of its stages was, as the executive judged it. Method: constructed ticks and
// frames; every instant is checked, and what is no first use makes no trace.
#include "monitor/telemetry/command_traces.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace takt::monitor {
namespace {

TickRecord first_use(std::uint64_t tick) {
  TickRecord record;
  record.header.tick = tick;
  record.header.now = MonoTime{1'000'000'000} + milliseconds(static_cast<std::int64_t>(tick));
  record.header.seats[Seat::policy].arrival = Arrival::accepted;
  record.header.seats[Seat::policy].freshness = Freshness::fresh;
  record.header.seats[Seat::policy].command_sequence = 7;
  record.header.seats[Seat::policy].observation_answered = 5;
  record.header.mode = Mode::tracking;
  record.header.age = {milliseconds(3), milliseconds(4), milliseconds(8), milliseconds(1), {}};
  return record;
}

FrameRecord sent(std::uint64_t tick, MonoTime at) {
  FrameRecord frame;
  frame.tick = tick;
  frame.stamp = at;
  frame.direction = FrameDirection::sent;
  return frame;
}

class CommandTracesTest : public testing::Test {
 protected:
  std::vector<CommandTrace> made_;
  CommandTraces traces_{[this](const CommandTrace& trace) { made_.push_back(trace); }};
};

TEST_F(CommandTracesTest, EveryStageHasItsInstant) {
  const TickRecord record = first_use(100);
  const MonoTime now = record.header.now;
  traces_.frame(sent(100, now + microseconds(40)));
  traces_.frame(sent(100, now + microseconds(60)));
  FrameRecord reply = sent(100, now + microseconds(900));
  reply.direction = FrameDirection::received;
  traces_.frame(reply);
  traces_.frame(sent(101, now + microseconds(1040)));
  traces_.tick(record);
  ASSERT_EQ(made_.size(), 1U);
  const CommandTrace& trace = made_[0];
  EXPECT_EQ(trace.sequence, 7U);
  EXPECT_EQ(trace.observation, 5U);
  EXPECT_EQ(trace.sensed_at, now - milliseconds(16));
  EXPECT_EQ(trace.observed_at, now - milliseconds(13));
  EXPECT_EQ(trace.infer_began_at, now - milliseconds(9));
  EXPECT_EQ(trace.infer_ended_at, now - milliseconds(1));
  EXPECT_EQ(trace.consumed_at, now);
  EXPECT_EQ(trace.actuating_at, now + microseconds(40));
  EXPECT_EQ(trace.actuated_at, now + microseconds(60));
}

TEST_F(CommandTracesTest, ATickWithoutFramesActuatesAtOnce) {
  traces_.tick(first_use(100));
  ASSERT_EQ(made_.size(), 1U);
  EXPECT_EQ(made_[0].actuating_at, made_[0].consumed_at);
  EXPECT_EQ(made_[0].actuated_at, made_[0].consumed_at);
}

TEST_F(CommandTracesTest, OnlyAFirstUseMakesATrace) {
  TickRecord later = first_use(101);
  later.header.seats[Seat::policy].arrival = Arrival::none;
  later.header.age.hold = milliseconds(1);
  traces_.tick(later);
  TickRecord spent = first_use(103);
  spent.header.seats[Seat::policy].freshness = Freshness::missing;
  traces_.tick(spent);
  EXPECT_TRUE(made_.empty());
}

TEST_F(CommandTracesTest, ARefusedCommandIsTracedAsRefused) {
  TickRecord refused = first_use(102);
  refused.header.seats[Seat::policy].arrival = Arrival::not_finite;
  refused.header.seats[Seat::policy].command_sequence_seen = 77;
  traces_.tick(refused);
  ASSERT_EQ(made_.size(), 1U);
  EXPECT_EQ(made_[0].arrival, Arrival::not_finite);
  EXPECT_EQ(made_[0].sequence, 77U);
  EXPECT_EQ(made_[0].actuated_at, refused.header.now) << "its stages are not known";
}

}  // namespace
}  // namespace takt::monitor
