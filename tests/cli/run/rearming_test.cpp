// SPDX-License-Identifier: Apache-2.0
// Goal: the person of a real-time panel acts by the rule of the simulated one, and only where a panel asks for one.
// Method: modes as the executive's status shows them, one after the other, and what is asked for in each.
#include "cli/run/rearming.hpp"

#include <gtest/gtest.h>

namespace takt::cli {
namespace {

TEST(Rearming, EndsAStopAfterItsTimeAndArmsAgain) {
  Rearming person(seconds(1));
  EXPECT_EQ(person.next(Mode::standby, seconds(0)), OperatorStep::none) << "the first arming is not his";
  EXPECT_EQ(person.next(Mode::tracking, seconds(1)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::damped_stop, seconds(2)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::damped_stop, milliseconds(2999)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::damped_stop, seconds(3)), OperatorStep::reset_if_only_the_stop_blocks);
  EXPECT_EQ(person.next(Mode::standby, milliseconds(3100)), OperatorStep::reset) << "looks where the joints stand";
  EXPECT_EQ(person.next(Mode::standby, milliseconds(3200)), OperatorStep::arm);
  EXPECT_EQ(person.next(Mode::tracking, seconds(4)), OperatorStep::none);
  EXPECT_EQ(person.next(Mode::fault_latched, seconds(5)), OperatorStep::none) << "the time counts anew";
  EXPECT_EQ(person.next(Mode::fault_latched, seconds(6)), OperatorStep::reset);
}

TEST(Rearming, NobodyIsThereUnlessAskedFor) {
  Rearming nobody(std::nullopt);
  for (const Mode mode : {Mode::damped_stop, Mode::fault_latched, Mode::standby})
    EXPECT_EQ(nobody.next(mode, seconds(100)), OperatorStep::none);
}

}  // namespace
}  // namespace takt::cli
