// SPDX-License-Identifier: Apache-2.0
// Goal: what waits between write and wire is known, whatever a bus loses, doubles or hands back that was never sent.
// Method: frames handed over and handed back by hand; random losses against a list kept the plain way.
#include "drivers/bus/sent_frames.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace takt::drivers {
namespace {

CanFrame frame_of(std::uint8_t number) {
  CanFrame frame;
  frame.id = 0x10;
  frame.length = 1;
  frame.data[0] = number;
  return frame;
}
MonoTime at(std::int64_t ms) {
  return MonoTime{} + milliseconds(ms);
}

TEST(SentFrames, TheOldestThatHasNotLeftWaits) {
  SentFrames sent;
  EXPECT_FALSE(sent.waiting_since().is_set());
  sent.handed_over(frame_of(1), at(1));
  sent.handed_over(frame_of(2), at(2));
  EXPECT_EQ(sent.waiting_since(), at(1));
  sent.left(frame_of(1), at(3));
  EXPECT_EQ(sent.waiting_since(), at(2));
  EXPECT_EQ(sent.left_at(), at(3));
  sent.left(frame_of(2), at(4));
  EXPECT_FALSE(sent.waiting_since().is_set());
  EXPECT_EQ(sent.left_at(), at(4));
}

TEST(SentFrames, OneThatWasLostEndsWithTheNextThatLeaves) {
  SentFrames sent;
  sent.handed_over(frame_of(1), at(1));
  sent.handed_over(frame_of(2), at(2));
  sent.handed_over(frame_of(3), at(3));
  sent.left(frame_of(2), at(4));
  EXPECT_EQ(sent.waiting_since(), at(3));
}

TEST(SentFrames, WhatWasNeverSentSaysNothing) {
  SentFrames sent;
  sent.handed_over(frame_of(1), at(1));
  CanFrame stranger = frame_of(1);
  stranger.extended = true;
  sent.left(stranger, at(2));
  sent.left(frame_of(9), at(2));
  EXPECT_EQ(sent.waiting_since(), at(1));
  EXPECT_FALSE(sent.left_at().is_set());
  sent.left(frame_of(1), at(3));
  sent.left(frame_of(1), at(9));  // doubled by the bus
  EXPECT_EQ(sent.left_at(), at(3));
}

TEST(SentFrames, WhatWasThrownAwayWaitsNoMore) {
  SentFrames sent;
  sent.handed_over(frame_of(1), at(1));
  sent.forget();
  EXPECT_FALSE(sent.waiting_since().is_set());
  sent.handed_over(frame_of(2), at(5));
  sent.left(frame_of(1), at(6));  // an adapter held it after all
  EXPECT_EQ(sent.waiting_since(), at(5));
}

// A dead bus is given hundreds: it is the first of them that grows old.
TEST(SentFrames, OfMoreThanThereIsRoomForTheOldestStillWaits) {
  SentFrames sent;
  for (std::uint8_t number = 0; number < 200; ++number) sent.handed_over(frame_of(number), at(1 + number));
  EXPECT_EQ(sent.waiting_since(), at(1));
  sent.left(frame_of(0), at(300));
  EXPECT_EQ(sent.waiting_since(), at(2));
  sent.left(frame_of(199), at(400));
  EXPECT_FALSE(sent.waiting_since().is_set()) << "those before it were lost";
  EXPECT_EQ(sent.left_at(), at(400));
  sent.handed_over(frame_of(1), at(500));
  EXPECT_EQ(sent.waiting_since(), at(500));
}

RC_GTEST_PROP(SentFrames, AgreesWithAPlainList, (const std::vector<std::uint8_t>& doings)) {
  SentFrames sent;
  std::vector<std::pair<std::uint8_t, MonoTime>> waiting;
  std::uint8_t next = 0;
  std::int64_t now = 1;
  for (const std::uint8_t doing : doings) {
    ++now;
    if (doing % 2 == 0 || waiting.empty()) {
      if (waiting.size() == SentFrames::kRoom) continue;
      waiting.emplace_back(next, at(now));
      sent.handed_over(frame_of(next++), at(now));
    } else {
      const auto gone = waiting.begin() + (doing / 2) % static_cast<int>(waiting.size());
      sent.left(frame_of(gone->first), at(now));
      waiting.erase(waiting.begin(), gone + 1);
    }
    RC_ASSERT(sent.waiting_since() == (waiting.empty() ? MonoTime{} : waiting.front().second));
  }
}

}  // namespace
}  // namespace takt::drivers
