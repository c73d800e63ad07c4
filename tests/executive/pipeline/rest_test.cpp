// Goal: drives are switched off, and a stop holds its position, only while the robot rests; an instant at rest is a
// turning point. Method: a moving robot in each latched mode, asked for a reset in every tick.
#include <gtest/gtest.h>

#include <cmath>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

constexpr Duration kDwell = milliseconds(100);

Rig moving() {
  Rig rig(robot(2));
  rig.arm(0.0F);
  rig.run_with_policy(300, 1.2F);
  return rig;
}

bool is_fast(const Rig& rig) {
  for (std::size_t j = 0; j < rig.config.joint_count; ++j)
    if (rig.out->drive_enabled[j] && std::abs(rig.out->record.joints[j].dq_estimate) >= rig.config.rest_velocity)
      return true;
  return false;
}

// Asks for a reset in every tick until it is granted; checks that every joint was slow for the dwell before.
void expect_reset_only_after_rest(Rig& rig) {
  MonoTime fast_at = rig.now;
  for (int i = 0; i < 3'000 && rig.mode() != Mode::standby; ++i) {
    rig.tick(nullptr, OperatorRequest::reset);
    if (is_fast(rig)) fast_at = rig.now;
  }
  EXPECT_EQ(rig.mode(), Mode::standby);
  EXPECT_GE(rig.now - fast_at, kDwell);
}

TEST(Rest, ALatchedFaultIsResetAtRestOnly) {
  Rig rig = moving();
  ASSERT_GT(std::abs(rig.drives[0].dq), 0.5F);
  rig.input.buses[0].state = BusState::bus_off;
  rig.tick();
  rig.input.buses[0].state = BusState::up;
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  expect_reset_only_after_rest(rig);
}

TEST(Rest, AJointWithoutPowerDelaysNoReset) {
  Rig rig(robot(2));
  rig.arm(0.0F);
  rig.run_with_policy(100, 0.0F);
  rig.drives[1].silent = true;
  for (int i = 0; i < 300; ++i) {
    rig.drives[1].dq = 2.5F;  // pushed, unseen
    rig.tick(nullptr, OperatorRequest::reset);
  }
  ASSERT_EQ(rig.mode(), Mode::fault_latched) << "feedback is lost still";
  rig.drives[1].silent = false;
  rig.drives[1].q = 0.3F;
  rig.drives[1].dq = 2.5F;  // nothing holds it, and a reset takes nothing from it
  for (int i = 0; i < 5 && rig.mode() != Mode::standby; ++i) rig.tick(nullptr, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::standby);
}

// A limb that sags is all there is: then it is asked.
TEST(Rest, ALimbThatOnlyDampsIsWaitedForWhereNothingElseHolds) {
  Rig rig = moving();
  rig.drives[1].fault = true;
  rig.tick();
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  rig.drives[1].fault = false;
  ASSERT_EQ(rig.out->setpoints[0].kp, 0.0F) << "damps";
  ASSERT_TRUE(is_fast(rig));
  expect_reset_only_after_rest(rig);
}

TEST(Rest, AStoppedRobotThatIsPushedIsNotResetMeanwhile) {
  Rig rig = moving();
  rig.tick(nullptr, OperatorRequest::stop);
  rig.run(1'500);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  ASSERT_GT(rig.out->setpoints[0].kp, 0.0F) << "rests, and holds";
  rig.drives[0].dq = 2.5F;
  rig.run(5);
  ASSERT_TRUE(is_fast(rig));
  expect_reset_only_after_rest(rig);
}

// The robot stands still for a tick less than the dwell, moves, and stands still again.
TEST(Rest, AnInstantAtRestIsATurningPoint) {
  Rig rig(robot(1));
  rig.arm(0.0F);
  rig.run_with_policy(300, 0.0F);
  ASSERT_FALSE(is_fast(rig));
  rig.tick(nullptr, OperatorRequest::stop);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  for (int i = 0; i < 100; ++i) {
    rig.tick(nullptr, OperatorRequest::reset);
    ASSERT_EQ(rig.out->setpoints[0].kp, 0.0F) << "holds after " << i << " ms";
    ASSERT_EQ(rig.mode(), Mode::damped_stop) << "reset after " << i << " ms";
  }
  rig.drives[0].dq = 1.0F;
  rig.run(5);
  ASSERT_TRUE(is_fast(rig));
  expect_reset_only_after_rest(rig);
}

TEST(Rest, OfAnEarlierStopCountsForNothing) {
  Rig rig(robot(1));
  for (int stop = 0; stop < 2; ++stop) {
    rig.arm(0.0F);
    rig.run_with_policy(300, 0.0F);
    rig.tick(nullptr, OperatorRequest::stop);
    ASSERT_EQ(rig.mode(), Mode::damped_stop);
    const MonoTime stopped_at = rig.now;
    expect_reset_only_after_rest(rig);
    EXPECT_GT(rig.now - stopped_at, kDwell) << "stop " << stop;
  }
}

}  // namespace
}  // namespace takt::pipeline
