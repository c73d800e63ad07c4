// SPDX-License-Identifier: Apache-2.0
// Goal: sleep waits in the kernel until the instant, hybrid until `spin` before it and polls from there. Method:
// virtual time.
#include "executive/runtime/wakeup.hpp"

#include <gtest/gtest.h>

#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

TEST(Wakeup, SleepModeSleepsUntilTheInstant) {
  VirtualClock clock;
  Wakeup wakeup(clock, config::WakeMode::sleep, microseconds(100));
  const MonoTime due = clock.now() + milliseconds(1);
  EXPECT_GE(wakeup.wait_until(due), due);
  EXPECT_EQ(clock.sleeps_until, std::vector{due});
  EXPECT_EQ(wakeup.spin().ns, 0) << "spin belongs to hybrid";
}

TEST(Wakeup, HybridSleepsUntilTheSpinAndPollsTheRest) {
  VirtualClock clock;
  Wakeup wakeup(clock, config::WakeMode::hybrid, microseconds(100));
  const MonoTime due = clock.now() + milliseconds(1);
  const MonoTime woken = wakeup.wait_until(due);
  EXPECT_EQ(clock.sleeps_until, std::vector{due - microseconds(100)});
  EXPECT_GE(woken, due);
  EXPECT_LE(woken, due + microseconds(1)) << "the first reading at or after the instant ends the spin";
}

TEST(Wakeup, HybridIsLateWhenTheSleepWas) {
  VirtualClock clock;
  clock.wake_delay = microseconds(250);
  Wakeup wakeup(clock, config::WakeMode::hybrid, microseconds(100));
  const MonoTime due = clock.now() + milliseconds(1);
  EXPECT_EQ(wakeup.wait_until(due), due + microseconds(151));
}

TEST(Wakeup, ThePastIsNotWaitedFor) {
  VirtualClock clock;
  Wakeup wakeup(clock, config::WakeMode::sleep, {});
  const MonoTime now = clock.now();
  EXPECT_EQ(wakeup.wait_until(now - seconds(1)), now + microseconds(1));
}

}  // namespace
}  // namespace takt::runtime::test
