// SPDX-License-Identifier: Apache-2.0
// Goal: the output that permits torque does so from the tick of arming to the tick that takes power, a joint's fault
// takes it where the robot file says so, and who cannot rely on it neither arms nor goes on. Method: the robot of
// rig.hpp; the test says what became of the output.
#include <gtest/gtest.h>

#include <array>

#include "executive/pipeline/causes.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::robot;

class OutputRig : public testing::Rig {
 public:
  explicit OutputRig(bool joint_fault_takes_torque = false) : Rig(with_output(joint_fault_takes_torque)) {
    input.torque_output = TorqueOutputState::as_told;
  }

 private:
  static TickConfig with_output(bool joint_fault_takes_torque) {
    TickConfig config = robot(3);
    config.has_torque_output = true;
    config.joint_fault_takes_torque = joint_fault_takes_torque;
    return config;
  }
};

TEST(TorqueOutput, IsPermittedFromArmingToStandby) {
  OutputRig rig;
  rig.run_with_policy(40, 0.3F);
  EXPECT_FALSE(rig.out->torque_permitted) << "standby";
  rig.tick_with_policy(0.3F, OperatorRequest::arm);
  ASSERT_EQ(rig.mode(), Mode::arming);
  EXPECT_TRUE(rig.out->torque_permitted) << "before the drives are told to enable, or with it";
  rig.run_with_policy(60, 0.3F);
  ASSERT_EQ(rig.mode(), Mode::tracking);
  EXPECT_TRUE(rig.out->torque_permitted);
  rig.tick_with_policy(0.3F, OperatorRequest::stop);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_TRUE(rig.out->torque_permitted) << "a category 2 stop keeps its power";
  rig.tick_with_policy(0.3F, OperatorRequest::deenergise);
  ASSERT_EQ(rig.mode(), Mode::standby);
  EXPECT_FALSE(rig.out->torque_permitted) << "in that very tick";
  EXPECT_EQ(rig.header().torque_permitted, 0);
}

TEST(TorqueOutput, IsNeverPermittedWhereTheRobotHasNone) {
  testing::Rig rig(robot(3));
  rig.arm();
  ASSERT_EQ(rig.mode(), Mode::tracking);
  EXPECT_FALSE(rig.out->torque_permitted);
}

TEST(TorqueOutput, AJointsFaultTakesItWhereTheRobotFileSaysSo) {
  for (const bool takes : {true, false}) {
    OutputRig rig(takes);
    rig.arm();
    rig.run_with_policy(100, 0.0F);
    rig.drives[1].fault = true;
    for (int i = 0; i < 3; ++i) rig.tick_with_policy(0.0F);
    ASSERT_EQ(rig.mode(), Mode::fault_latched);
    EXPECT_EQ(rig.out->torque_permitted, !takes);
  }
}

TEST(TorqueOutput, OneThatFailsStopsTheRobotAndNobodyArms) {
  for (const TorqueOutputState doubt : {TorqueOutputState::failed, TorqueOutputState::none}) {
    OutputRig rig;
    rig.arm();
    ASSERT_EQ(rig.mode(), Mode::tracking);
    rig.input.torque_output = doubt;
    rig.tick_with_policy(0.0F);
    EXPECT_EQ(rig.mode(), Mode::damped_stop);
    EXPECT_EQ(rig.header().cause, Cause::torque_output_lost);
    rig.run_with_policy(500, 0.0F);
    rig.tick_with_policy(0.0F, OperatorRequest::reset);
    ASSERT_EQ(rig.mode(), Mode::standby);
    rig.run_with_policy(40, 0.0F);
    rig.tick_with_policy(0.0F, OperatorRequest::arm);
    EXPECT_EQ(rig.mode(), Mode::standby);
    std::array<ArmingBlocker, 1> blocker;
    ASSERT_EQ(arming_blockers(rig.out->record, rig.config, blocker), 1U);
    EXPECT_NE(blocker[0].what.find("safety.safe_torque_off"), std::string_view::npos) << blocker[0].what;
    rig.input.torque_output = TorqueOutputState::as_told;
    rig.arm();
    EXPECT_EQ(rig.mode(), Mode::tracking) << "it works again";
  }
}

TEST(TorqueOutput, ReplayIsToldWhatBecameOfIt) {
  OutputRig rig;
  rig.input.torque_output = TorqueOutputState::failed;
  rig.tick_with_policy(0.0F);
  EXPECT_EQ(input_of(rig.out->record, nullptr, 0).torque_output, TorqueOutputState::failed);
}

}  // namespace
}  // namespace takt::pipeline
