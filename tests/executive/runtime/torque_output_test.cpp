// SPDX-License-Identifier: Apache-2.0
// Goal: the output that permits torque is told in every tick, before any frame of it leaves, and taken with the loop's
// last frames; what becomes of it reaches the next tick. Method: the loop in virtual time in front of ports that
// remember.
#include <gtest/gtest.h>

#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

TEST(TorqueOutput, ItIsToldBeforeTheFirstFrameOfATick) {
  LoopRig rig;
  std::vector<std::size_t> frames_before;
  rig.torque->on_tell = [&](bool) { frames_before.push_back(rig.sent.size()); };
  rig.run(5);
  ASSERT_EQ(frames_before.size(), 5U + kFarewellTicks);
  for (std::size_t tick = 0; tick < frames_before.size(); ++tick)
    EXPECT_EQ(frames_before[tick], tick * rig.config.joint_count) << tick;
}

TEST(TorqueOutput, WhatBecomesOfItReachesTheNextTick) {
  LoopRig rig;
  int told = 0;
  rig.torque->on_tell = [&](bool) { rig.torque->works = ++told != 2; };
  rig.run(4);
  const std::vector<TickRecord> records = rig.records();
  ASSERT_EQ(records.size(), 4U);
  EXPECT_EQ(records[0].header.torque_output, TorqueOutputState::none) << "nothing is known of it before it was told";
  EXPECT_EQ(records[1].header.torque_output, TorqueOutputState::as_told);
  EXPECT_EQ(records[2].header.torque_output, TorqueOutputState::failed);
  EXPECT_EQ(records[3].header.torque_output, TorqueOutputState::as_told);
}

}  // namespace
}  // namespace takt::runtime::test
