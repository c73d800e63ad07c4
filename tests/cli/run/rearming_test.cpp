// SPDX-License-Identifier: Apache-2.0
// Goal: the person of a real-time panel acts by the rule of the simulated one, and only where a panel asks for one.
// Method: modes as the executive's status shows them, one after the other, and what is asked for in each.
#include "cli/run/rearming.hpp"

#include <gtest/gtest.h>

namespace takt::cli {
namespace {

TEST(Rearming, EndsAStopAfterItsTimeAndArmsAgain) {
  Rearming person(seconds(1));
  EXPECT_EQ(person.next(Mode::standby, false, seconds(0)), OperatorStep::none) << "the first arming is not his";
  EXPECT_EQ(person.next(Mode::tracking, false, seconds(1)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::damped_stop, false, seconds(2)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::damped_stop, false, milliseconds(2999)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::damped_stop, false, seconds(3)), OperatorStep::reset_if_only_the_stop_blocks);
  EXPECT_EQ(person.next(Mode::standby, false, milliseconds(3100)), OperatorStep::reset)
      << "looks where the joints stand";
  EXPECT_EQ(person.next(Mode::standby, false, milliseconds(3200)), OperatorStep::arm);
  EXPECT_EQ(person.next(Mode::tracking, false, seconds(4)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::fault_latched, false, seconds(5)), OperatorStep::none) << "the time counts anew";
  EXPECT_EQ(person.next(Mode::fault_latched, false, seconds(6)), OperatorStep::reset);
}

TEST(Rearming, DoesNothingUnlessAskedFor) {
  Rearming off(std::nullopt);
  for (const Mode mode : {Mode::damped_stop, Mode::fault_latched, Mode::standby})
    EXPECT_EQ(off.next(mode, false, seconds(100)), OperatorStep::none);
}

// Goal: who stops the robot decides when it moves again. Method: a stop and a press for no power by another operator;
// the newest incident stays the same in standby; then that operator arms the robot, and the next stop is the robot's
// own.
TEST(Rearming, LeavesAStopThatAnotherAskedFor) {
  for (const Mode ended : {Mode::damped_stop, Mode::fault_latched}) {
    Rearming person(seconds(1));
    EXPECT_EQ(person.next(Mode::tracking, false, seconds(1)), OperatorStep::none);
    EXPECT_EQ(person.next(ended, true, seconds(2)), OperatorStep::none);
    EXPECT_EQ(person.next(ended, true, seconds(60)), OperatorStep::none);
    EXPECT_EQ(person.next(Mode::standby, true, seconds(61)), OperatorStep::none) << "reset, or without power";
    EXPECT_EQ(person.next(Mode::standby, true, seconds(100)), OperatorStep::none);
    EXPECT_EQ(person.next(Mode::tracking, true, seconds(101)), OperatorStep::none) << "armed by the one who stopped it";
    EXPECT_EQ(person.next(Mode::damped_stop, false, seconds(102)), OperatorStep::none);
    EXPECT_EQ(person.next(Mode::damped_stop, false, seconds(103)), OperatorStep::reset_if_only_the_stop_blocks);
  }
}

// A press while the robot's own stop stands takes the power: from then on it is that operator's.
TEST(Rearming, APressDuringAnotherStopTakesItOver) {
  Rearming person(seconds(1));
  EXPECT_EQ(person.next(Mode::damped_stop, false, seconds(2)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::standby, true, milliseconds(2500)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::standby, true, seconds(60)), OperatorStep::none);
}

}  // namespace
}  // namespace takt::cli
