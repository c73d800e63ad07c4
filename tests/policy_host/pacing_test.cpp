// SPDX-License-Identifier: Apache-2.0
// Goal: the host is there when an observation must be, never spins, never sleeps for long. Method: instants around one
// observation published at 100 ms with a period of 20 ms.
#include "policy_host/pacing.hpp"

#include <gtest/gtest.h>

namespace takt::policy_host {
namespace {

constexpr MonoTime kPublished = MonoTime{} + milliseconds(100);
constexpr Duration kPeriod = milliseconds(20);
constexpr MonoTime kDue = kPublished + kPeriod + kPublishMargin;

TEST(Pacing, SleepsUntilTheNextObservationIsDue) {
  EXPECT_EQ(next_look(kPublished + milliseconds(1), kPublished, kPeriod, false), kDue);
  EXPECT_EQ(next_look(kPublished + milliseconds(1), kPublished, kPeriod, true), kDue);
}

TEST(Pacing, LooksAtOnceAfterALongInferenceButOnlyOnce) {
  const MonoTime late = kDue + milliseconds(5);
  EXPECT_EQ(next_look(late, kPublished, kPeriod, false), late);
  EXPECT_EQ(next_look(late, kPublished, kPeriod, true), late + kShortPoll);
}

TEST(Pacing, LooksRarelyWhenNothingComes) {
  const MonoTime long_after = kDue + seconds(3);
  EXPECT_EQ(next_look(long_after, kPublished, kPeriod, true), long_after + kLongPoll);
  EXPECT_EQ(next_look(kDue, MonoTime{}, kPeriod, false), kDue + kLongPoll) << "before the first observation";
}

TEST(Pacing, NonsenseStampCannotPutItToSleep) {
  const MonoTime now = kPublished;
  EXPECT_EQ(next_look(now, now + seconds(1'000'000), kPeriod, false), now + kPeriod * 2);
}

// Goal: several requests in flight answer evenly. Method: inferences of 120 ms, one and three at a time.
TEST(RequestPacing, SpreadsRequestsOverAnInference) {
  RequestPacing one(1), three(3);
  for (RequestPacing* const pacing : {&one, &three}) {
    EXPECT_FALSE(pacing->next().is_set()) << "before the first";
    pacing->asked(kPublished);
    pacing->took(milliseconds(120));
  }
  EXPECT_FALSE(one.next().is_set()) << "whenever the only one is free";
  EXPECT_EQ(three.next(), kPublished + milliseconds(40));
  three.took(milliseconds(360));
  EXPECT_EQ(three.next(), kPublished + milliseconds(50)) << "one long inference moves the average by an eighth";
}

}  // namespace
}  // namespace takt::policy_host
