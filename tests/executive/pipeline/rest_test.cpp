// SPDX-License-Identifier: Apache-2.0
// Goal: drives are switched off, and a stop holds its position, only while the robot rests; an instant at rest is a
// turning point. Method: a moving robot in each latched mode, asked for a reset in every tick.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <span>

#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/rest_watch.hpp"
#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

constexpr Duration kDwell = milliseconds(100);

// A tree says what hangs on what; nothing weighs anything.
TickConfig weightless_chain(std::uint32_t joints) {
  TickConfig config = robot(joints);
  config.gravity_compensation = true;
  config.gravity = {};
  return config;
}

Rig moving(const TickConfig& config = robot(2)) {
  Rig rig(config);
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

// Asks for a reset in every tick until it is granted; checks that in the dwell before it no joint that had power got
// further than at the rest velocity.
void expect_reset_only_after_rest(Rig& rig) {
  std::deque<Positions> been;
  for (int i = 0; i < 3'000 && rig.mode() != Mode::standby; ++i) {
    Positions& now = been.emplace_back();
    for (std::size_t j = 0; j < rig.config.joint_count; ++j) now.at[j] = rig.drives[j].q;
    if (been.size() > 101) been.pop_front();
    for (std::size_t j = 0; j < rig.config.joint_count; ++j)
      if (!rig.out->drive_enabled[j]) been.back().at[j] = std::numeric_limits<float>::quiet_NaN();
    rig.tick(nullptr, OperatorRequest::reset);
  }
  EXPECT_EQ(rig.mode(), Mode::standby);
  EXPECT_EQ(been.size(), 101U) << "the dwell";
  for (std::size_t j = 0; j < rig.config.joint_count; ++j)
    for (const Positions& at : been)
      EXPECT_FALSE(std::abs(at.at[j] - been.back().at[j]) > 0.1F * rig.config.rest_velocity) << "joint " << j;
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
  Rig rig = moving(weightless_chain(2));
  rig.drives[0].fault = true;
  rig.tick();
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  rig.drives[0].fault = false;
  ASSERT_EQ(rig.out->setpoints[1].kp, 0.0F) << "damps";
  ASSERT_TRUE(is_fast(rig));
  expect_reset_only_after_rest(rig);
}

// Goal: a reset takes the power of every joint, so it waits for those that sag as well, however still the others hold.
// Method: what hangs on a faulty joint is kept moving; the rest of the robot rests and holds meanwhile.
TEST(Rest, AResetWaitsForWhatHangsOnALostJointToo) {
  Rig rig = moving(weightless_chain(3));
  rig.drives[1].fault = true;
  rig.tick();
  rig.drives[1].fault = false;
  for (int i = 0; i < 1'000; ++i) {
    rig.drives[2].dq = 0.5F;
    rig.tick(nullptr, OperatorRequest::reset);
    ASSERT_EQ(rig.mode(), Mode::fault_latched) << "reset after " << i << " ms";
  }
  EXPECT_EQ(rig.state->mode.resting, 1) << "what can hold rests, and holds";
  expect_reset_only_after_rest(rig);
}

// Where it never rests, a person takes the power.
TEST(Rest, WhatNeverRestsIsLeftByAPersonsPresses) {
  for (const bool at_once : {false, true}) {
    Rig rig = moving(weightless_chain(3));
    rig.drives[1].fault = true;
    for (int i = 0; i < 500; ++i) {
      rig.drives[2].dq = 0.5F;
      const bool presses = i == 100 || i == 350;
      rig.tick(nullptr, at_once ? (i == 100 ? OperatorRequest::deenergise : OperatorRequest::none)
                                : (presses ? OperatorRequest::press_stop : OperatorRequest::reset));
    }
    EXPECT_EQ(rig.mode(), Mode::standby) << at_once;
  }
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

// Goal: steps of an encoder are no motion; creeping slower than the rest velocity is rest, faster is not, a turning
// point is not. Method: one joint's estimate is played to the watch as a 14-bit encoder has it, a tick each
// millisecond. Returns the first tick at which it is said to rest, 0 if none of 2 s.
template <class Position>
int tick_of_rest(Position&& position) {
  constexpr float kStep = 6.2832F / 16'384;
  RestWatch watch;
  JointRecord joint;
  for (int tick = 1; tick <= 2'000; ++tick) {
    joint.q_estimate = std::floor(position(static_cast<float>(tick) * 0.001F) / kStep) * kStep;
    const MonoTime now = MonoTime{} + milliseconds(tick);
    watch.follow(now, std::span(&joint, 1), JointMask{1}, [](std::size_t) { return 0.02F; });
    if (watch.rests(now)) return tick;
  }
  return 0;
}

TEST(Rest, StepsOfAnEncoderAreNoMotion) {
  EXPECT_EQ(tick_of_rest([](float) { return 0.5F; }), 101);
  EXPECT_EQ(tick_of_rest([](float t) { return 0.01F * t; }), 101);
  EXPECT_EQ(tick_of_rest([](float t) { return -0.01F * t; }), 101);
  EXPECT_EQ(tick_of_rest([](float t) { return 0.03F * t; }), 0);
  EXPECT_EQ(tick_of_rest([](float t) { return 0.05F * std::sin(10.0F * t); }), 0)
      << "turns round, at 0.5 rad/s between";
  EXPECT_GE(tick_of_rest([](float t) { return 0.5F * std::exp(-4.0F * t); }), 1'150) << "creeps to rest";
  EXPECT_EQ(tick_of_rest([](float) { return std::numeric_limits<float>::quiet_NaN(); }), 0);
}

TEST(Rest, AJointThatIsNotAskedMayMove) {
  RestWatch watch;
  std::array<JointRecord, 2> joints;
  for (int tick = 1; tick <= 101; ++tick) {
    joints[1].q_estimate += 0.01F;
    watch.follow(MonoTime{} + milliseconds(tick), joints, JointMask{1}, [](std::size_t) { return 0.02F; });
  }
  EXPECT_TRUE(watch.rests(MonoTime{} + milliseconds(101)));
  joints[1].q_estimate += 0.01F;
  watch.follow(MonoTime{} + milliseconds(102), joints, JointMask{3}, [](std::size_t) { return 0.02F; });
  EXPECT_FALSE(watch.rests(MonoTime{} + milliseconds(102))) << "from now on it is asked, and it moved";
}

}  // namespace
}  // namespace takt::pipeline
