// SPDX-License-Identifier: Apache-2.0
// Goal: the sliding window counts exactly, whatever its length. Method: random marks against a plain list.
#include "executive/pipeline/tick_window.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>

namespace takt::pipeline {
namespace {

TEST(TickWindow, KeyframesCarryEveryWordThatIsUsed) {
  for (std::uint32_t length = 1; length <= kMaxWindowTicks; ++length)
    ASSERT_EQ(TickWindow::saved_bytes(length), 16U + (length / 64U + (length % 64U != 0 ? 1U : 0U)) * 8U) << length;
}

RC_GTEST_PROP(TickWindow, CountsWhatAPlainListCounts, ()) {
  const auto length = static_cast<std::uint32_t>(*rc::gen::inRange(1, 300));
  const auto marks = *rc::gen::container<std::vector<bool>>(1000, rc::gen::arbitrary<bool>());
  const auto restart_at = static_cast<std::size_t>(*rc::gen::inRange(0, 1000));
  const auto window = std::make_unique<TickWindow>();
  std::deque<bool> plain;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (i == restart_at) {
      window->restart();
      plain.clear();
    }
    window->push(marks[i], length);
    plain.push_back(marks[i]);
    if (plain.size() > length) plain.pop_front();
    RC_ASSERT(window->count() == static_cast<std::uint32_t>(std::count(plain.begin(), plain.end(), true)));
    RC_ASSERT(window->seen() == plain.size());
    RC_ASSERT(window->fits(length));
  }
}

// As a keyframe may say it: position, seen, count.
TEST(TickWindow, CountersThatCannotBeAreNotBelieved) {
  const auto fits = [](std::uint32_t position, std::uint32_t seen, std::uint32_t count) {
    const std::uint32_t counters[3] = {position, seen, count};
    const auto window = std::make_unique<TickWindow>();
    std::memcpy(static_cast<void*>(window.get()), counters, sizeof counters);
    return window->fits(64);
  };
  EXPECT_TRUE(fits(63, 64, 64));
  EXPECT_FALSE(fits(64, 64, 0));
  EXPECT_FALSE(fits(0, 65, 0));
  EXPECT_FALSE(fits(0, 3, 4));
}

TEST(TickWindow, HoldsItsLargestLength) {
  const auto window = std::make_unique<TickWindow>();
  for (std::uint32_t i = 0; i < 3 * kMaxWindowTicks; ++i) window->push(i >= 2 * kMaxWindowTicks, kMaxWindowTicks);
  EXPECT_EQ(window->count(), kMaxWindowTicks);
}

}  // namespace
}  // namespace takt::pipeline
