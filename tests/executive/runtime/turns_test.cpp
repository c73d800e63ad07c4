// SPDX-License-Identifier: Apache-2.0
// Goal: a drive with turns gets a frame in its turns and in no other tick, every drive gets one in the tick that
// changes the mode, and the last frames of the loop reach everybody. Method: the loop in virtual time in front of buses
// that remember what was sent.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

const std::vector<Turns> kTurns{{1, 0}, {3, 1}, {3, 2}};

// Ticks in which joint j was sent something, the farewell aside; `ids` are j + 1.
std::map<std::uint32_t, std::set<std::uint64_t>> ticks_of(LoopRig& rig, std::uint64_t last) {
  std::map<std::uint32_t, std::set<std::uint64_t>> ticks;
  for (const FrameRecord& frame : rig.frames())
    if (frame.direction == FrameDirection::sent && frame.tick < last) ticks[frame.can_id].insert(frame.tick);
  return ticks;
}

TEST(Turns, ADriveIsWrittenToInItsTicks) {
  LoopRig rig(3, 2, {{}, {}, 100}, nullptr, kTurns);
  rig.run(60);
  const auto ticks = ticks_of(rig, 60);
  ASSERT_EQ(ticks.size(), 3U);
  auto joint = ticks.begin();
  EXPECT_EQ(joint->second.size(), 59U);
  for (std::size_t j = 1; j < 3; ++j) {
    ++joint;
    EXPECT_GE(joint->second.size(), 19U);
    for (const std::uint64_t tick : joint->second) EXPECT_EQ(tick % 3, kTurns[j].phase) << "joint " << j;
  }
}

TEST(Turns, TheLastFramesAreEverybodys) {
  LoopRig rig(3, 2, {{}, {}, 100}, nullptr, kTurns);
  rig.run(60);  // in tick 60 it is the first one's turn alone
  std::map<std::uint32_t, int> last;
  for (const FrameRecord& frame : rig.frames())
    if (frame.direction == FrameDirection::sent && frame.tick == 60) ++last[frame.can_id];
  ASSERT_EQ(last.size(), 3U);
  for (const auto& [id, frames] : last) EXPECT_GE(frames, kFarewellTicks) << id;
}

// By the record alone: what the edge asks is what the record says.
TEST(Turns, AChangeOfModeIsEverybodysTurn) {
  LoopRig rig(3, 2, {{}, {}, 100}, nullptr, kTurns);
  pipeline::TickOutput output;
  output.record.header.tick = 3;  // the first joint's turn, and neither other's
  output.record.header.joint_count = 3;
  const SuspendWatch suspend(rig.clock.read_boot_time());
  rig.edge.send(output, rig.clock, suspend, rig.published);
  EXPECT_EQ(rig.sent.size(), 1U);
  output.record.header.previous_mode = Mode::tracking;
  output.record.header.mode = Mode::damped_stop;
  rig.edge.send(output, rig.clock, suspend, rig.published);
  EXPECT_EQ(rig.sent.size(), 4U);
}

}  // namespace
}  // namespace takt::runtime::test
