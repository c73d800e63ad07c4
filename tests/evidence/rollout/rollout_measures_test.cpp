// SPDX-License-Identifier: Apache-2.0
// Goal: what a row says of all joints together is of a slide's motor, so that newtons are not taken for newton metres.
// Method: ticks in which one joint alone has a torque and a reference that moves, as a hinge and as a slide of 100 rad
// to a metre.
#include "evidence/rollout/rollout_measures.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace takt::lab {
namespace {

evidence::RolloutRow row_of(config::JointKind kind) {
  config::RobotConfig robot;
  robot.joints.resize(2);
  robot.joints[1].kind = kind;
  robot.joints[1].drive.gear_ratio = 100;
  const evidence::Disturbance disturbance({}, MonoTime{1});
  evidence::RolloutMeasures measures({.settled = {1}, .begins = {1}, .bound_m = 1}, disturbance, robot);
  const auto record = std::make_unique<TickRecord>();
  record->header.joint_count = 2;
  record->header.mode = record->header.previous_mode = Mode::tracking;
  for (int tick = 0; tick < 6; ++tick) {
    record->header.tick = static_cast<std::uint64_t>(tick);
    record->header.now = MonoTime{1} + milliseconds(1) * (tick + 1);
    record->joints[1].feedback.tau = tick % 2 == 0 ? 25.0F : 20.0F;
    record->joints[1].feedback.dq = 0.01F;
    record->joints[1].dq_reference = tick < 4 ? 0.0F : 0.001F;
    measures.tick(*record, {});
  }
  evidence::RolloutRow row;
  measures.finish(0.05, 0.95, row);
  return row;
}

TEST(RolloutMeasures, OfAllJointsTogetherASlideCountsAtItsMotor) {
  const evidence::RolloutRow hinge = row_of(config::JointKind::hinge), slide = row_of(config::JointKind::slide);
  EXPECT_NEAR(hinge.peak_torque_Nm, 25, 1e-6);
  EXPECT_NEAR(slide.peak_torque_Nm, 0.25, 1e-6);
  EXPECT_NEAR(slide.torque_rate_Nm_s, hinge.torque_rate_Nm_s / 100, 1e-6);
  EXPECT_GT(hinge.torque_rate_Nm_s, 0);
  EXPECT_NEAR(slide.peak_reference_jerk, 100 * hinge.peak_reference_jerk, 1e-3);
  EXPECT_GT(hinge.peak_reference_jerk, 0);
  EXPECT_NEAR(slide.energy_J, hinge.energy_J, 1e-9) << "newtons times metres are joules already";
}

}  // namespace
}  // namespace takt::lab
