// SPDX-License-Identifier: Apache-2.0
// Goal: an overrun skips exactly the instants that have passed, and the grid never moves. Method: property over random
// ends.
#include "executive/contract/pace.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace takt {
namespace {

constexpr MonoTime kFirst{5'000'000};
constexpr Duration kPeriod = milliseconds(1);

TEST(Pace, InTimeMeansTheNextInstant) {
  Pace pace(kFirst, kPeriod);
  EXPECT_EQ(pace.advance(kFirst + microseconds(300)), 0U);
  EXPECT_EQ(pace.due(), kFirst + kPeriod);
  EXPECT_EQ(pace.advance(kFirst + kPeriod * 2), 0U) << "ending exactly when the next is due is in time";
  EXPECT_EQ(pace.skipped(), 0U);
}

TEST(Pace, OneNanosecondTooLateSkipsOne) {
  Pace pace(kFirst, kPeriod);
  EXPECT_EQ(pace.advance(kFirst + kPeriod + nanoseconds(1)), 1U);
  EXPECT_EQ(pace.due(), kFirst + kPeriod * 2);
}

RC_GTEST_PROP(Pace, KeepsPhaseAndCountsWhatItSkipped, ()) {
  Pace pace(kFirst, kPeriod);
  std::uint64_t ran = 0;
  for (const auto work : *rc::gen::container<std::vector<std::int64_t>>(rc::gen::inRange<std::int64_t>(0, 7'000'000))) {
    const MonoTime due = pace.due();
    const MonoTime end = due + nanoseconds(work);
    pace.advance(end);
    ++ran;
    RC_ASSERT((pace.due() - kFirst).ns % kPeriod.ns == 0);
    RC_ASSERT(pace.due() >= end && pace.due() > due);
    RC_ASSERT(pace.due() - kPeriod < end || pace.due() - kPeriod == due);
    RC_ASSERT(pace.due() == kFirst + kPeriod * static_cast<std::int64_t>(ran + pace.skipped()));
  }
}

}  // namespace
}  // namespace takt
