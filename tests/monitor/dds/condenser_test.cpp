// SPDX-License-Identifier: Apache-2.0
// Goal: ROS 2 is told what the records say, at the promised pace, and nothing old or made up. Method: the virtual
// robot's ticks, condensed; every message compared with the record it comes from.
#include "monitor/dds/condenser.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/monitor/dds/condensed_robot.hpp"

namespace takt::monitor::dds {
namespace {

TEST(Condenser, JointStatesKeepTheConfiguredRate) {
  for (const std::size_t rate : {30U, 100U, 1000U}) {
    CondensedRobot demo(static_cast<double>(rate));
    demo.run(2000);
    EXPECT_NEAR(static_cast<double>(demo.joint_states.size()), 2.0 * static_cast<double>(rate), 1) << rate << " Hz";
  }
}

TEST(Condenser, JointStatesAreTheRecordsAndBearTheStampOfTheOldestSample) {
  CondensedRobot demo(1000);
  demo.run(500);
  ASSERT_FALSE(demo.joint_states.empty());
  const JointStates& message = demo.joint_states.back();
  const TickRecord& record = demo.robot.latest();
  ASSERT_EQ(message.position.size(), demo.config.joints.size());
  MonoTime oldest = record.header.now;
  for (std::size_t joint = 0; joint < demo.config.joints.size(); ++joint) {
    EXPECT_EQ(message.position[joint], static_cast<double>(record.joints[joint].feedback.q));
    EXPECT_EQ(message.velocity[joint], static_cast<double>(record.joints[joint].dq_estimate));
    EXPECT_EQ(message.effort[joint], static_cast<double>(record.joints[joint].feedback.tau));
    oldest = std::min(oldest, record.joints[joint].feedback.received_at);
  }
  EXPECT_EQ(message.unix_ns, oldest.ns + kOffset);
}

TEST(Condenser, NothingIsSaidOfJointsThatWereNeverHeardOrFellSilent) {
  CondensedRobot demo(1000);
  demo.robot.run(10);
  TickRecord record = demo.robot.latest();
  record.joints[2].feedback.received_at = {};
  demo.tell(record);
  EXPECT_TRUE(demo.joint_states.empty()) << "a joint that never answered has no position";
  for (int tick = 0; tick < 20; ++tick) {
    record.header.now = record.header.now + milliseconds(1);
    record.joints[2].feedback.received_at = {1000};
    demo.tell(record);
  }
  EXPECT_EQ(demo.joint_states.size(), 1U) << "the same old sample is not told twice";
}

// One drive that falls silent does not hide the others; the stamp says how old the message may be, and never goes back.
TEST(Condenser, OneSilentJointDoesNotSilenceTheRobot) {
  CondensedRobot demo(1000);
  MonoTime silent_since;
  demo.robot.spoil_input = [&](pipeline::TickInput& input) {
    if (input.tick == 400) silent_since = input.joints[2].received_at;
    if (input.tick >= 400 && input.tick < 600) input.joints[2].received_at = silent_since;
  };
  demo.run(800);
  ASSERT_NEAR(static_cast<double>(demo.joint_states.size()), 800, 1);
  EXPECT_TRUE(std::ranges::is_sorted(demo.joint_states, {}, &JointStates::unix_ns));
  const auto stamped = [&](MonoTime at) {
    return std::ranges::count(demo.joint_states, at.ns + kOffset, &JointStates::unix_ns);
  };
  EXPECT_GE(stamped(silent_since), 199) << "each with what the other joints say";
  EXPECT_EQ(demo.joint_states.back().unix_ns, demo.robot.latest().joints[5].feedback.received_at.ns + kOffset);
}

TEST(Condenser, EveryCommandIsToldOnceWithItsAgeAtFirstUse) {
  CondensedRobot demo(100);
  std::vector<TickRecordHeader> first_uses;
  for (int tick = 0; tick < 1500; ++tick) {
    demo.run(1);
    const TickRecordHeader& header = demo.robot.latest().header;
    if (header.seats[Seat::policy].arrival == Arrival::accepted) first_uses.push_back(header);
  }
  ASSERT_GT(first_uses.size(), 50U);
  ASSERT_EQ(demo.command_ages.size(), first_uses.size());
  for (std::size_t i = 0; i < first_uses.size(); ++i) {
    const CommandAge& told = demo.command_ages[i];
    EXPECT_EQ(told.tick, first_uses[i].tick);
    EXPECT_EQ(told.sequence, first_uses[i].seats[Seat::policy].command_sequence);
    EXPECT_EQ(told.observation, first_uses[i].seats[Seat::policy].observation_answered);
    EXPECT_EQ(told.age.total(), first_uses[i].age.total());
    EXPECT_EQ(told.age.hold.ns, 0) << "first use";
    EXPECT_EQ(told.unix_ns, first_uses[i].now.ns + kOffset);
  }
}

TEST(Condenser, AChangeOfModeIsToldAtOnceAndOtherwiseAtItsPace) {
  CondensedRobot demo(100);
  demo.run(3000);
  EXPECT_NEAR(static_cast<double>(demo.status.size()), 30, 4);
  EXPECT_NEAR(static_cast<double>(demo.diagnostics.size()), 3, 4);
  std::vector<std::uint64_t> changes;
  for (const Status& status : demo.status)
    if (status.tick.mode != status.tick.previous_mode) changes.push_back(status.tick.tick);
  ASSERT_EQ(changes.size(), 2U) << "standby -> arming -> tracking";
  const auto arming = std::ranges::find(demo.status, Mode::arming, [](const Status& s) { return s.tick.mode; });
  ASSERT_NE(arming, demo.status.end());
  EXPECT_EQ(arming->cause, Cause::operator_arm);
  EXPECT_EQ(demo.status.back().tick.mode, Mode::tracking);
  EXPECT_EQ(demo.status.back().cause, Cause::drives_enabled) << "the cause stays until the next change";
  for (const Status& status : demo.status) {
    if (status.tick.mode == status.tick.previous_mode) continue;
    EXPECT_TRUE(std::ranges::any_of(demo.diagnostics, [&](const Diagnostics& d) {
      return d.unix_ns == status.unix_ns;
    })) << "diagnostics too";
  }
}

TEST(Condenser, HistoryIsNotNews) {
  VirtualRobot clock;
  clock.run(1);
  CondensedRobot demo(1000, clock.latest().header.now + milliseconds(700));
  demo.run(700);
  EXPECT_TRUE(demo.status.empty());
  EXPECT_TRUE(demo.joint_states.empty());
  EXPECT_TRUE(demo.command_ages.empty());
  demo.run(10);
  EXPECT_FALSE(demo.status.empty());
  EXPECT_FALSE(demo.joint_states.empty());
}

TEST(Condenser, TheEndIsTold) {
  CondensedRobot demo(100);
  demo.run(300);
  demo.status.clear();
  demo.diagnostics.clear();
  demo.condenser.end();
  demo.collect();
  ASSERT_EQ(demo.status.size(), 1U);
  EXPECT_FALSE(demo.status[0].running);
  ASSERT_EQ(demo.diagnostics.size(), 1U);
  EXPECT_EQ(demo.diagnostics[0].parts.at(0).level, Level::stale);
}

}  // namespace
}  // namespace takt::monitor::dds
