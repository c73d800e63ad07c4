// SPDX-License-Identifier: Apache-2.0
// Goal: a frame that the last guard refused is a fault of ours that latches and is trusted with nothing more than
// damping; one that only came too late is none; either way the next tick goes on from what the drive was really told.
// Method: the rig's next tick is told of a refusal, as the edge does it.
#include <gtest/gtest.h>

#include <cmath>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

Rig tracking_rig() {
  Rig rig(robot(3));
  rig.arm(0.0F);
  rig.run_with_policy(200, 1.0F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  return rig;
}

void tick_after_refusal(Rig& rig, std::size_t joint, WireVerdict verdict) {
  rig.input.joints[joint].refused = verdict;
  rig.tick_with_policy(1.0F);
  rig.input.joints[joint].refused = WireVerdict::allowed;
}

TEST(RefusedFrame, EveryVerdictThatIsABugLatchesTheFault) {
  for (std::size_t i = 1; i < kWireVerdictCount; ++i) {
    const auto verdict = static_cast<WireVerdict>(i);
    Rig rig = tracking_rig();
    tick_after_refusal(rig, 1, verdict);
    EXPECT_EQ(rig.mode(), is_bug(verdict) ? Mode::fault_latched : Mode::tracking) << kWireVerdictNames[i];
    EXPECT_EQ(rig.header().cause, is_bug(verdict) ? Cause::internal_error : Cause::none) << kWireVerdictNames[i];
    EXPECT_EQ(rig.out->record.joints[1].feedback.refused, verdict) << "the record is what replay reads";
  }
}

// No gravity model either: it may be what was wrong.
TEST(RefusedFrame, AfterwardsTheWholeRobotDamps) {
  Rig rig = tracking_rig();
  tick_after_refusal(rig, 1, WireVerdict::torque);
  rig.run(300);
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_TRUE(rig.out->drive_enabled[j]);
    EXPECT_EQ(rig.out->setpoints[j].kp, 0.0F);
    EXPECT_EQ(rig.out->setpoints[j].tau, 0.0F);
    EXPECT_EQ(rig.out->setpoints[j].kd, rig.config.joints[j].damping);
  }
}

TEST(RefusedFrame, TorqueBeginsAnewAndTheReferenceWaits) {
  Rig rig = tracking_rig();
  const JointRecord before = rig.out->record.joints[1];
  tick_after_refusal(rig, 1, WireVerdict::expired);
  const JointRecord after = rig.out->record.joints[1];
  const float step = rig.config.joints[1].limits.torque_rate * 0.001F;
  EXPECT_LE(std::abs(after.tau_total), step * 1.001F) << "from none, whatever the tick before decided";
  EXPECT_NEAR(after.q_reference, before.q_reference, 1e-5F) << "one step on from the last that was sent";
}

}  // namespace
}  // namespace takt::pipeline
