// SPDX-License-Identifier: Apache-2.0
// Goal: a fault reaches as far as the table says: the joint it is about gets no power, what hangs on it damps, the rest
// of its limb holds, the rest of the robot carries its weight, comes to rest and holds; nothing heals before the
// operator's reset.
// Method: two arms of three joints on one base, in virtual time with gravity.
#include <gtest/gtest.h>

#include <cmath>

#include "executive/pipeline/limbs.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

// Joints 0..2 and 3..5: an arm each.
TickConfig two_arms() {
  TickConfig config = robot(6);
  config.gravity_compensation = true;
  config.bus_count = 2;
  for (std::size_t j = 3; j < 6; ++j) config.joints[j].bus = 1;
  config.links[3].parent = -1;
  return config;
}

TEST(Limbs, AreSerialPiecesOfTheTreeAndWhatHangsOnThem) {
  TickConfig config = robot(8);
  config.gravity_compensation = true;
  // 0 torso; 1, 2 left arm; 3, 4 right arm; 5, 6 fingers of the right; 7 a head on the base.
  const std::int32_t parents[] = {-1, 0, 1, 0, 3, 4, 4, -1};
  for (std::size_t j = 0; j < 8; ++j) config.links[j].parent = parents[j];
  const Limbs limbs(config);
  EXPECT_EQ(limbs.of(bit_of_joint(2)), 0b0000'0110U) << "an arm, its shoulder included, the torso left out";
  EXPECT_EQ(limbs.of(bit_of_joint(1)), 0b0000'0110U);
  EXPECT_EQ(limbs.of(bit_of_joint(3)), 0b0111'1000U);
  EXPECT_EQ(limbs.of(bit_of_joint(5)), 0b0010'0000U) << "one finger";
  EXPECT_EQ(limbs.of(bit_of_joint(0)), 0b0111'1111U) << "all that the torso carries";
  EXPECT_EQ(limbs.of(bit_of_joint(7)), 0b1000'0000U);
  EXPECT_EQ(limbs.of(bit_of_joint(5) | bit_of_joint(7)), 0b1010'0000U);
  EXPECT_EQ(limbs.of(0), 0U);
  EXPECT_EQ(limbs.beyond(bit_of_joint(4)), 0b0111'0000U) << "the hand, not the shoulder";
  EXPECT_EQ(limbs.beyond(bit_of_joint(2)), 0b0000'0100U);
  EXPECT_EQ(limbs.beyond(bit_of_joint(0)), 0b0111'1111U);
  EXPECT_EQ(limbs.beyond(0), 0U);
}

TEST(Limbs, WithoutATreeTheRobotIsOne) {
  const Limbs limbs(robot(5));
  EXPECT_EQ(limbs.of(bit_of_joint(3)), 0b1'1111U);
  EXPECT_EQ(limbs.beyond(bit_of_joint(3)), 0b0'1000U) << "what hangs on it is not known";
  TickConfig free = robot(5);
  free.imu.present = true;
  EXPECT_EQ(Limbs(free).beyond(bit_of_joint(3)), 0b1'1111U) << "stiff joints do not keep it on its feet";
}

struct Case {
  const char* when;
  void (*cause)(Rig&);
  Cause expected;
  JointMask about;
};
const Case kCases[] = {
    {"silent", [](Rig& r) { r.drives[4].silent = true; }, Cause::feedback_lost, 0b01'0000},
    {"faulty", [](Rig& r) { r.drives[4].fault = true; }, Cause::drive_fault, 0b01'0000},
    {"dropped out", [](Rig& r) { r.drives[4].drops_out = true; }, Cause::drive_disabled, 0b01'0000},
    {"jumped", [](Rig& r) { r.drives[4].q += 0.4F; }, Cause::feedback_implausible, 0b01'0000},
    {"bus off", [](Rig& r) { r.input.buses[1].state = BusState::bus_off; }, Cause::bus_off, 0b11'1000},
    {"bus down", [](Rig& r) { r.input.buses[1].state = BusState::down; }, Cause::bus_down, 0b11'1000},
};

TEST(Scope, TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds) {
  for (const Case& one : kCases) {
    Rig rig(two_arms());
    rig.arm(0.3F);
    rig.run_with_policy(1500, 0.3F);
    ASSERT_EQ(rig.mode(), Mode::tracking) << one.when;
    float before[3];
    for (std::size_t j = 0; j < 3; ++j) before[j] = rig.drives[j].q;
    one.cause(rig);
    for (int i = 0; i < 40 && rig.mode() == Mode::tracking; ++i) rig.tick_with_policy(0.3F);
    ASSERT_EQ(name(rig.header().cause), name(one.expected));
    ASSERT_EQ(rig.mode(), Mode::fault_latched);
    for (int i = 0; i < 3000; ++i) {
      for (std::size_t j = 0; j < 6; ++j) {
        const JointSetpoint& s = rig.out->setpoints[j];
        const bool about = (one.about & bit_of_joint(j)) != 0;
        ASSERT_EQ(rig.out->drive_enabled[j], !about) << one.when << ", joint " << j << ", tick " << i;
        ASSERT_TRUE(!about || (s.kp == 0 && s.kd == 0 && s.tau == 0 && s.dq == 0)) << one.when << ", joint " << j;
        ASSERT_TRUE(j < 4 || s.kp == 0) << one.when << ": what hangs on it damps, joint " << j;
        ASSERT_TRUE(j != 3 || about || s.kp > 0) << one.when << ": what it hangs on holds, joint " << j;
      }
      rig.tick();
    }
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_NEAR(rig.drives[j].q, before[j], 0.02F) << one.when << ": healthy joint " << j;
      EXPECT_GT(rig.out->setpoints[j].kp, 0.0F) << one.when << ": holds at rest, joint " << j;
    }
    // A drive without power is no longer disabled by itself, and a joint that jumped is heard where it is by now.
    const bool is_gone = one.expected == Cause::drive_disabled || one.expected == Cause::feedback_implausible;
    EXPECT_TRUE(rig.header().causes_active & bit(one.expected) || is_gone) << one.when;
  }
}

// What hangs on a lost joint carries no weight that it is not sure of: damping, and nothing else.
TEST(Scope, WhatHangsOnALostJointOnlyDamps) {
  Rig rig(two_arms());
  rig.arm(0.3F);
  rig.run_with_policy(500, 0.3F);
  rig.drives[3].silent = true;
  for (int i = 0; i < 100; ++i) rig.tick_with_policy(0.3F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  EXPECT_GT(std::abs(rig.out->record.joints[4].tau_gravity), 0.1F) << "the model's word, not followed";
  for (const std::size_t j : {4U, 5U}) {
    const JointRecord& joint = rig.out->record.joints[j];
    EXPECT_NEAR(joint.tau_total, -rig.config.joints[j].damping * joint.dq_estimate, 0.02F) << j;
  }
  EXPECT_GT(std::abs(rig.out->record.joints[0].tau_gravity), 0.5F);
  EXPECT_NEAR(rig.out->record.joints[0].tau_total, rig.out->record.joints[0].tau_gravity, 0.5F);
}

TEST(Scope, ADriveThatIsHeardAgainStaysWithoutPowerUntilTheReset) {
  Rig rig(two_arms());
  rig.arm(0.3F);
  rig.drives[4].silent = true;
  for (int i = 0; i < 40; ++i) rig.tick_with_policy(0.3F);
  rig.drives[4].silent = false;
  for (int i = 0; i < 500; ++i) {
    rig.tick_with_policy(0.3F);
    ASSERT_FALSE(rig.out->drive_enabled[4]) << i;
  }
  // A second drive goes while the first fault is latched.
  rig.drives[1].fault = true;
  rig.tick_with_policy(0.3F);
  EXPECT_FALSE(rig.out->drive_enabled[1]);
  EXPECT_TRUE(rig.out->drive_enabled[0]);
  rig.drives[1].fault = false;
  rig.run_with_policy(500, 0.3F);
  EXPECT_FALSE(rig.out->drive_enabled[1]);
  rig.tick_with_policy(0.3F, OperatorRequest::deenergise);  // both limbs sag: nothing here ever rests
  ASSERT_EQ(rig.mode(), Mode::standby);
  rig.arm(0.3F);
  ASSERT_EQ(rig.mode(), Mode::tracking);
  for (std::size_t j = 0; j < 6; ++j) EXPECT_TRUE(rig.out->drive_enabled[j]);
}

TEST(Scope, ADriveThatDoesNotEnableIsGivenUpAndTheRestIsCarried) {
  Rig rig(two_arms());
  rig.drives[3].never_enables = true;
  rig.run_with_policy(40, 0.1F);
  rig.tick_with_policy(0.1F, OperatorRequest::arm);
  for (int i = 0; i < 1000 && rig.mode() == Mode::arming; ++i) rig.tick_with_policy(0.1F);
  EXPECT_FALSE(rig.out->drive_enabled[3]) << "from the first tick on";
  for (int i = 0; i < 700; ++i) rig.tick_with_policy(0.1F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  for (std::size_t j = 0; j < 6; ++j) EXPECT_EQ(rig.out->drive_enabled[j], j != 3) << j;
  EXPECT_EQ(rig.out->setpoints[4].kp, 0.0F) << "what hangs on it damps";
  EXPECT_GT(rig.out->setpoints[0].kp, 0.0F) << "the other arm is at rest and holds";
}

// Goal: a joint on which a lost one hangs holds from its measured motion: no faster than it was, braked by no more than
// its limit, no step of torque. Method: the last joint of a limb falls silent while the others move.
TEST(Scope, WhatCarriesALostJointBrakesFromItsMotionAndHolds) {
  for (const bool has_tree : {true, false}) {
    TickConfig config = two_arms();
    config.gravity_compensation = has_tree;
    Rig rig(config);
    rig.arm(0.0F);
    rig.run_with_policy(300, 1.2F);
    const float began = rig.drives[3].q, speed = std::abs(rig.drives[3].dq);
    ASSERT_GT(speed, 0.5F);
    const JointLimits& limits = config.joints[3].limits;
    rig.drives[5].silent = true;
    float torque = rig.out->record.joints[3].tau_total, most = speed, at_stop = 0;
    for (int i = 0; i < 2000; ++i) {
      rig.tick_with_policy(1.2F);
      const bool stopped = rig.mode() == Mode::fault_latched;
      ASSERT_EQ(rig.out->setpoints[3].kp > 0, true) << i;
      if (!stopped) {
        most = std::max(most, std::abs(rig.drives[3].dq));
        at_stop = rig.drives[3].q;
      }
      ASSERT_LE(std::abs(rig.drives[3].dq), most + 0.02F) << i << ", tree: " << has_tree;
      ASSERT_LE(std::abs(rig.out->record.joints[3].tau_total - torque), 1.01F * limits.torque_rate * 0.001F) << i;
      torque = rig.out->record.joints[3].tau_total;
    }
    ASSERT_EQ(rig.mode(), Mode::fault_latched);
    EXPECT_NEAR(rig.drives[3].dq, 0.0F, 0.01F);
    EXPECT_LE(std::abs(rig.drives[3].q - at_stop), most * most / (2 * limits.acceleration) + 0.05F)
        << "tree: " << has_tree << ", it was at " << began << " when the other fell silent";
    EXPECT_EQ(rig.out->setpoints[5].kp, 0.0F);
  }
}

// Goal: a joint that was not heard when it might have begun to hold begins with the motion in which it is heard.
// Method: its part is taken as damped for a while by a suspend, in which it is pushed.
TEST(Scope, AJointThatIsHeardAgainHoldsFromWhereItIs) {
  Rig rig(robot(2));
  rig.arm(0.3F);
  rig.run_with_policy(500, 0.3F);
  rig.drives[1].fault = true;
  rig.run_with_policy(200, 0.3F);
  ASSERT_GT(rig.out->setpoints[0].kp, 0.0F);
  rig.input.slept_ms = 500;
  rig.drives[0].q = 0.9F;
  rig.tick();
  rig.input.slept_ms = 0;
  for (int i = 0; i < 500; ++i) {
    rig.tick();
    ASSERT_NEAR(rig.drives[0].q, 0.9F, 0.01F) << i << ": nobody fetches it back";
  }
  EXPECT_GT(rig.out->setpoints[0].kp, 0.0F) << "and it holds again";
}

// Goal: what a lost joint last said of its speed keeps no joint from resting.
TEST(Scope, RestIsJudgedWithoutTheStaleVelocityOfALostJoint) {
  Rig rig(two_arms());
  rig.arm(0.0F);
  rig.run_with_policy(300, 1.2F);
  ASSERT_GT(std::abs(rig.drives[4].dq), 0.5F);
  rig.drives[4].silent = true;
  for (int i = 0; i < 3000; ++i) rig.tick_with_policy(0.0F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  ASSERT_GT(std::abs(rig.out->record.joints[4].dq_estimate), 0.5F) << "all that is known of it";
  EXPECT_GT(rig.out->setpoints[0].kp, 0.0F) << "the other arm holds";
}

// The same where the lost joint is in the only limb there is.
TEST(Scope, ARobotOfOneLimbRestsWithoutItsLostJointToo) {
  Rig rig(robot(3));
  rig.arm(0.0F);
  rig.run_with_policy(300, 1.2F);
  rig.drives[2].silent = true;
  for (int i = 0; i < 1500; ++i) rig.tick_with_policy(0.0F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  ASSERT_GT(std::abs(rig.out->record.joints[2].dq_estimate), 0.5F);
  EXPECT_EQ(rig.state->mode.resting, 1);
}

// Goal: a joint whose loop is closed here is not pushed by a reading that stands still. Its torque frames would also
// feed the drive's own watchdog for ever. Method: one joint at 3 rad/s; it obeys and is no longer heard.
TEST(Scope, ALostJointOfAHostClosedLoopIsNotDriven) {
  TickConfig config = robot(1);
  config.joints[0].loop = LoopAt::host_torque;
  config.joints[0].limits.q_min = -100;
  config.joints[0].limits.q_max = 100;
  Rig rig(config);
  rig.arm(0.0F);
  rig.drives[0].dq = 3.0F;
  rig.run_with_policy(5, 0.0F);
  ASSERT_GT(rig.out->record.joints[0].dq_estimate, 0.5F);
  rig.drives[0].silent = true;
  float fastest = 0;
  for (int i = 0; i < 5000; ++i) {
    rig.tick();
    fastest = std::max(fastest, std::abs(rig.drives[0].dq));
    if (i > 20) {
      ASSERT_FALSE(rig.out->drive_enabled[0]);
      ASSERT_EQ(rig.out->setpoints[0].tau, 0.0F);
    }
  }
  EXPECT_LE(fastest, 3.0F);
}

// The table says it; the tick does it.
TEST(Scope, TheTablesPowerColumnIsWhatTheTickTakes) {
  for (const Case& one : kCases) EXPECT_EQ(reaction(one.expected).stops.joints, Stop::category_0) << one.when;
  int rows = 0;
  for (const Reaction& row : kReactions) rows += row.stops.joints == Stop::category_0 ? 1 : 0;
  EXPECT_EQ(rows, 7) << "the six above and enable_timeout";
}

}  // namespace
}  // namespace takt::pipeline
