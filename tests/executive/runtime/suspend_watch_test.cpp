// SPDX-License-Identifier: Apache-2.0
// Goal: every suspend of the computer is noticed, and nothing else is taken for one. Method: readings made by hand;
// readings taken apart by preemption, at random.
#include "executive/runtime/suspend_watch.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "executive/runtime/clock.hpp"

namespace takt::runtime {
namespace {

constexpr Duration kLead = seconds(100);  // slept before the executive began

BootReading reading_at(MonoTime before, Duration lead, Duration gap, Duration second_gap) {
  const MonoTime middle = before + gap;
  return {before, middle - MonoTime{} + lead, middle + second_gap};
}

TEST(SuspendWatch, ASleepIsToldOnceAndWhole) {
  SuspendWatch watch(reading_at({1'000}, kLead, {20}, {20}));
  EXPECT_EQ(watch.slept(reading_at({2'000}, kLead, {20}, {20})), Duration{});
  const Duration slept = watch.slept(reading_at({3'000}, kLead + seconds(5), {20}, {20}));
  EXPECT_LE(slept, seconds(5));
  EXPECT_GE(slept, seconds(5) - nanoseconds(100));
  EXPECT_EQ(watch.slept(reading_at({4'000}, kLead + seconds(5), {20}, {20})), Duration{});
  EXPECT_GT(watch.slept(reading_at({5'000}, kLead + seconds(6), {20}, {20})), milliseconds(999));
}

// A look in between does not take the news from the next tick.
TEST(SuspendWatch, ALookTellsOfASleepAndLeavesItToBeTold) {
  SuspendWatch watch(reading_at({1'000}, kLead, {20}, {20}));
  const auto boot_at = [](MonoTime now) { return now - MonoTime{} + kLead; };
  EXPECT_FALSE(watch.has_slept(boot_at({2'000}), {2'020}));
  EXPECT_FALSE(watch.has_slept(boot_at({2'000}), MonoTime{2'000} + seconds(1))) << "preempted between the readings";
  EXPECT_TRUE(watch.has_slept(boot_at({3'000}) + seconds(5), {3'020}));
  EXPECT_GT(watch.slept(reading_at({4'000}, kLead + seconds(5), {20}, {20})), milliseconds(4'999));
  EXPECT_FALSE(watch.has_slept(boot_at({5'000}) + seconds(5), {5'020}));
}

RC_GTEST_PROP(SuspendWatch, PreemptionBetweenTwoReadingsIsNoSleep, ()) {
  const auto gaps =
      *rc::gen::container<std::vector<std::int64_t>>(40, rc::gen::inRange<std::int64_t>(0, 1'000'000'000));
  MonoTime now{1'000};
  SuspendWatch watch(reading_at(now, kLead, {gaps[0]}, {gaps[1]}));
  for (std::size_t i = 2; i + 1 < gaps.size(); i += 2) {
    now = now + seconds(3);
    RC_ASSERT(watch.slept(reading_at(now, kLead, {gaps[i]}, {gaps[i + 1]})) == Duration{});
  }
  RC_ASSERT(watch.slept(reading_at(now + seconds(3), kLead + seconds(60), {gaps[0]}, {gaps[1]})) > seconds(57));
}

TEST(SuspendWatch, TheComputerDoesNotSleepDuringThisTest) {
  SystemClock clock;
  SuspendWatch watch(clock.read_boot_time());
  for (int i = 0; i < 10'000; ++i) ASSERT_EQ(watch.slept(clock.read_boot_time()), Duration{});
}

}  // namespace
}  // namespace takt::runtime
