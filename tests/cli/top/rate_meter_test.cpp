// SPDX-License-Identifier: Apache-2.0
// Goal: a rate is what came in the last ten whole bins, whatever the order within them. Method: steady, late, stopped
// and resumed arrivals with known counts.
#include "cli/top/rate_meter.hpp"

#include <gtest/gtest.h>

namespace takt::monitor::top {
namespace {

constexpr MonoTime kStart{1'000'000'000'000};

TEST(RateMeter, ASteadyStreamHasItsRateFromTheFirstSecondOn) {
  RateMeter meter;
  MonoTime now = kStart;
  for (int i = 0; i < 1000; ++i, now = now + milliseconds(20)) {
    if (i >= 60) {
      EXPECT_EQ(meter.per_second(now), 100) << i;
    }
    meter.add(now, 2);
  }
}

TEST(RateMeter, WhatCameBeforeTheLastSecondIsForgotten) {
  RateMeter meter;
  meter.add(kStart, 5);
  EXPECT_EQ(meter.per_second(kStart), 0) << "its bin is still being filled";
  EXPECT_EQ(meter.per_second(kStart + milliseconds(100)), 5);
  EXPECT_EQ(meter.per_second(kStart + milliseconds(1000)), 5);
  EXPECT_EQ(meter.per_second(kStart + milliseconds(1100)), 0);
  meter.add(kStart + seconds(60), 1);
  EXPECT_EQ(meter.per_second(kStart + seconds(60) + milliseconds(500)), 1) << "no bin keeps an older lap's amount";
}

TEST(RateMeter, OrderWithinASecondDoesNotMatter) {
  RateMeter meter;
  meter.add(kStart + milliseconds(900), 1);
  meter.add(kStart, 1);
  meter.add(kStart - seconds(2), 1);  // too old to count
  EXPECT_EQ(meter.per_second(kStart + milliseconds(1000)), 2);
}

}  // namespace
}  // namespace takt::monitor::top
