// SPDX-License-Identifier: Apache-2.0
// Goal: a person always gets the drives without power, at once and in every mode; a press of the stop does so when a
// stop is in force; a program that repeats its stop never does. Method: the tick in every mode, with silent and faulty
// drives.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

struct Situation {
  const char* when;
  Mode mode;
  std::function<void(Rig&)> reach;
};

void track(Rig& rig) {
  rig.arm(0.3F);
  rig.run_with_policy(100, 0.3F);
}

const Situation kSituations[] = {
    {"arming", Mode::arming,
     [](Rig& rig) {
       rig.drives[1].never_enables = true;
       rig.run_with_policy(40, 0.3F);
       rig.tick_with_policy(0.3F, OperatorRequest::arm);
       rig.run_with_policy(10, 0.3F);
     }},
    {"tracking", Mode::tracking, track},
    {"degraded", Mode::degraded,
     [](Rig& rig) {
       track(rig);
       for (int i = 0; i < 1000 && rig.mode() == Mode::tracking; ++i) rig.tick();
     }},
    {"damped stop, moving", Mode::damped_stop,
     [](Rig& rig) {
       track(rig);
       rig.run(900);
     }},
    {"a silent drive", Mode::fault_latched,
     [](Rig& rig) {
       track(rig);
       rig.drives[1].silent = true;
       rig.run_with_policy(100, 0.3F);
     }},
    {"bus off and a faulty drive", Mode::fault_latched,
     [](Rig& rig) {
       track(rig);
       rig.input.buses[0].state = BusState::bus_off;
       rig.drives[0].fault = true;
       rig.run_with_policy(100, 0.3F);
     }},
};

void expect_no_power(const Rig& rig, const char* when) {
  EXPECT_EQ(rig.mode(), Mode::standby) << when;
  EXPECT_EQ(rig.header().cause, Cause::operator_deenergise) << when;
  for (std::size_t j = 0; j < 3; ++j) EXPECT_FALSE(rig.out->drive_enabled[j]) << when;
}

TEST(OperatorStop, DeenergisesInTheVeryTickFromEveryMode) {
  for (const Situation& situation : kSituations) {
    Rig rig(robot(3));
    situation.reach(rig);
    ASSERT_EQ(rig.mode(), situation.mode) << situation.when;
    rig.tick_with_policy(0.3F, OperatorRequest::deenergise);
    expect_no_power(rig, situation.when);
    rig.run_with_policy(100, 0.3F);
    EXPECT_EQ(rig.mode(), Mode::standby) << situation.when << ": nothing brings the power back by itself";
  }
}

TEST(OperatorStop, WinsOverOurOwnBug) {
  Rig rig(robot(3));
  track(rig);
  rig.config.joints[0].kp = NAN;  // the arithmetic of this very tick fails
  rig.config.joints[0].damping = NAN;
  rig.tick_with_policy(0.3F, OperatorRequest::deenergise);
  expect_no_power(rig, "internal error in the same tick");
}

TEST(OperatorStop, TheSecondPressTakesThePowerAway) {
  for (const Situation& situation : kSituations) {
    Rig rig(robot(3));
    situation.reach(rig);
    rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
    EXPECT_EQ(rig.mode(), situation.mode == Mode::fault_latched ? Mode::fault_latched : Mode::damped_stop)
        << situation.when << ": the first press is a stop";
    rig.run_with_policy(99, 0.3F);
    rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
    EXPECT_NE(rig.mode(), Mode::standby) << situation.when << ": a trembling hand is one press";
    rig.run_with_policy(99, 0.3F);
    rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
    expect_no_power(rig, situation.when);
  }
}

// Goal: what keeps a robot stopped. Method: arming is asked for after one press, and after two.
TEST(OperatorStop, AfterOnePressArmingIsRefusedAndAfterTwoItIsNot) {
  for (const int presses : {1, 2}) {
    Rig rig(robot(3));
    track(rig);
    for (int press = 0; press < presses; ++press) {
      rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
      rig.run_with_policy(1000, 0.3F);
    }
    rig.tick_with_policy(0.3F, OperatorRequest::arm);
    rig.run_with_policy(100, 0.3F);
    EXPECT_EQ(rig.mode(), presses == 1 ? Mode::damped_stop : Mode::tracking);
  }
}

TEST(OperatorStop, AProgramThatRepeatsItsStopNeverTakesThePower) {
  for (const Situation& situation : kSituations) {
    Rig rig(robot(3));
    situation.reach(rig);
    for (int i = 0; i < 1000; ++i) rig.tick_with_policy(0.3F, OperatorRequest::stop);
    EXPECT_TRUE(is_latched(rig.mode())) << situation.when;
    rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
    EXPECT_TRUE(is_latched(rig.mode())) << situation.when << ": a person's first press while that stop is in force";
    rig.run_with_policy(200, 0.3F);
    rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
    EXPECT_EQ(rig.mode(), Mode::standby) << situation.when << ": the second press";
  }
}

// Goal: who stops an arming never sees a drive come on afterwards. Method: one drive takes its time.
TEST(OperatorStop, WhileArmingLeavesOffWhatIsStillOff) {
  Rig rig(robot(3));
  rig.drives[1].never_enables = true;
  rig.run_with_policy(40, 0.3F);
  rig.tick_with_policy(0.3F, OperatorRequest::arm);
  rig.run_with_policy(20, 0.3F);
  ASSERT_EQ(rig.mode(), Mode::arming);
  rig.tick_with_policy(0.3F, OperatorRequest::stop);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_TRUE(rig.out->drive_enabled[0]);
  EXPECT_FALSE(rig.out->drive_enabled[1]);
  rig.drives[1].never_enables = false;
  for (int i = 0; i < 300; ++i) {
    rig.tick_with_policy(0.3F);
    ASSERT_FALSE(rig.out->drive_enabled[1]) << i;
  }
}

// What stopped by itself is stopped by the first press, which is no second one.
TEST(OperatorStop, AStopThatNobodyAskedForIsNotAFirstPress) {
  Rig rig(robot(3));
  track(rig);
  rig.run(900);
  ASSERT_EQ(rig.header().mode, Mode::damped_stop);
  rig.tick(nullptr, OperatorRequest::press_stop);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
}

// A stop is forgotten with the reset: the next one is a first one again.
TEST(OperatorStop, AResetForgetsTheFirstPress) {
  Rig rig(robot(3));
  track(rig);
  rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
  rig.run_with_policy(1000, 0.3F);
  rig.tick_with_policy(0.3F, OperatorRequest::reset);
  ASSERT_EQ(rig.mode(), Mode::standby);
  track(rig);
  rig.tick_with_policy(0.3F, OperatorRequest::press_stop);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
}

}  // namespace
}  // namespace takt::pipeline
