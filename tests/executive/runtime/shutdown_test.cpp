// SPDX-License-Identifier: Apache-2.0
// Goal: the loop ends when it is safe to, and in bounded time. Method: table of situations after a first signal at t =
// 10 s.
#include "executive/runtime/shutdown.hpp"

#include <gtest/gtest.h>

namespace takt::runtime {
namespace {

constexpr MonoTime kSignal{10'000'000'000};

struct Row {
  const char* when;
  Duration after;
  bool noticed;
  Mode mode;
  bool rests;
  bool may_end;
};
const Row kRows[] = {
    {"standby, but no tick has read the request", milliseconds(1), false, Mode::standby, true, false},
    {"standby", milliseconds(1), true, Mode::standby, false, true},
    {"still tracking although at rest", milliseconds(50), true, Mode::tracking, true, false},
    {"stopping, still moving", milliseconds(500), true, Mode::damped_stop, false, false},
    {"stopped and at rest", milliseconds(500), true, Mode::damped_stop, true, true},
    {"faulted and at rest", milliseconds(500), true, Mode::fault_latched, true, true},
    {"faulted, still moving", milliseconds(500), true, Mode::fault_latched, false, false},
    {"just before the limit", kLongestStop - nanoseconds(1), true, Mode::damped_stop, false, false},
    {"never at rest: the limit", kLongestStop, true, Mode::damped_stop, false, true},
    {"no tick has read the request yet", kNoticedWithin - nanoseconds(1), false, Mode::tracking, false, false},
    {"the control thread hangs", kNoticedWithin, false, Mode::tracking, false, true},
};

TEST(Shutdown, Table) {
  for (const Row& row : kRows) {
    Shutdown shutdown;
    shutdown.signal(kSignal);
    EXPECT_EQ(shutdown.may_end(kSignal + row.after, row.noticed, row.mode, row.rests), row.may_end) << row.when;
  }
}

TEST(Shutdown, WithoutASignalNothingEndsIt) {
  const Shutdown shutdown;
  EXPECT_FALSE(shutdown.is_requested());
  EXPECT_FALSE(shutdown.may_end(kSignal, true, Mode::standby, true));
}

TEST(Shutdown, ASecondSignalEndsItAtOnce) {
  Shutdown shutdown;
  shutdown.signal(kSignal);
  shutdown.signal(kSignal + milliseconds(1));
  EXPECT_TRUE(shutdown.may_end(kSignal + milliseconds(1), false, Mode::tracking, false));
}

}  // namespace
}  // namespace takt::runtime
