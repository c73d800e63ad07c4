// SPDX-License-Identifier: Apache-2.0
// Goal: of every tick it is known when its frames had left, as far as the buses say, and never earlier than they did.
// Method: ticks of 1 ms made by hand with what a prompt bus, a slow adapter, a dead one and one that says nothing say.
#include "monitor/judge/wire_watch.hpp"

#include <gtest/gtest.h>

namespace takt::monitor {
namespace {

MonoTime at_us(std::int64_t us) {
  return MonoTime{} + seconds(1) + microseconds(us);
}

TickRecordHeader tick(std::uint64_t number, MonoTime left_at, MonoTime waiting_since = {}) {
  TickRecordHeader header{};
  header.tick = number;
  header.now = at_us(static_cast<std::int64_t>(number) * 1000);
  header.bus_count = 1;
  header.player = Player::policy;
  header.age.hold = milliseconds(40);
  header.buses[0].left_at = left_at;
  header.buses[0].waiting_since = waiting_since;
  return header;
}

TEST(WireWatch, APromptBusIsToldOneTickLater) {
  WireWatch watch;
  EXPECT_FALSE(watch.take(tick(1, {}))[0]);
  const auto first = watch.take(tick(2, at_us(1'080)))[0];
  ASSERT_TRUE(first);
  EXPECT_EQ(first->since_tick, microseconds(80));
  EXPECT_EQ(first->age, milliseconds(40) + microseconds(80));
  EXPECT_EQ(watch.take(tick(3, at_us(2'300)))[0]->since_tick, microseconds(300));
}

TEST(WireWatch, ATickThatPlayedNoCommandHasNoAge) {
  WireWatch watch;
  TickRecordHeader quiet = tick(1, {});
  quiet.player = Player::none;
  watch.take(quiet);
  const auto found = watch.take(tick(2, at_us(1'080)))[0];
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->age);
}

TEST(WireWatch, ASlowAdapterIsFollowedTickByTick) {
  WireWatch watch;
  watch.take(tick(1, {}));
  EXPECT_FALSE(watch.take(tick(2, {}, at_us(1'050)))[0]) << "all of tick 1 waits";
  EXPECT_FALSE(watch.take(tick(3, at_us(2'900), at_us(1'070)))[0]) << "the rest of it waits";
  const auto first = watch.take(tick(4, at_us(3'600), at_us(2'050)))[0];
  ASSERT_TRUE(first);
  EXPECT_EQ(first->since_tick, microseconds(2'600)) << "tick 2 waits: tick 1 has left";
  const auto third = watch.take(tick(5, at_us(4'800), at_us(4'050)))[0];
  ASSERT_TRUE(third);
  EXPECT_EQ(third->since_tick, microseconds(1'800)) << "of tick 3, the newest that has left";
}

TEST(WireWatch, WhatIsNotSaidIsNotTold) {
  WireWatch silent;
  for (std::uint64_t number = 1; number < 50; ++number) EXPECT_FALSE(silent.take(tick(number, {}))[0]);
  WireWatch dead;
  dead.take(tick(1, {}));
  dead.take(tick(2, at_us(1'080)));
  for (std::uint64_t number = 3; number < 50; ++number)
    EXPECT_FALSE(dead.take(tick(number, at_us(1'080), at_us(2'050)))[0]) << "it stands still";
  EXPECT_FALSE(dead.take(tick(50, at_us(1'080)))[0]) << "its queue was emptied: nothing left";
  EXPECT_TRUE(dead.take(tick(51, at_us(50'090)))[0]);
}

}  // namespace
}  // namespace takt::monitor
