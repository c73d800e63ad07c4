// SPDX-License-Identifier: Apache-2.0
// Goal: a gamepad's values are the sensor's own, never outside its limits, and only while its button is held and it is
// heard; what is cut, frozen, late or lying says nothing. Method: events by hand against values worked out by hand,
// each trouble once, and random events whose every value is judged as a policy host would.
#include "sensors/gamepad/gamepad.hpp"

#include <gtest/gtest.h>

#include <random>

namespace takt::sensors {
namespace {

constexpr MonoTime kStart{1'000'000'000'000};

GamepadMapping mapping() {
  return {.dead_man = BTN_TL,
          .sticks = {{.code = ABS_Y, .reversed = true, .minimum = -32768, .maximum = 32767},
                     {.code = ABS_RX, .minimum = 0, .maximum = 255}},
          .limits = {.minimum = {-0.5, -1}, .maximum = {0.3, 2}, .when_absent = {0, 0.7}},
          .still_for = milliseconds(200)};
}

input_event event(std::uint16_t type, std::uint16_t code, std::int32_t value, MonoTime at) {
  input_event made{};
  made.input_event_sec = at.ns / seconds(1).ns;
  made.input_event_usec = at.ns % seconds(1).ns / microseconds(1).ns;
  made.type = type;
  made.code = code;
  made.value = value;
  return made;
}

// Held since kStart, sticks in the middle.
Gamepad held() {
  Gamepad pad(mapping());
  pad.take(event(EV_KEY, BTN_TL, 1, kStart), kStart);
  return pad;
}

std::vector<float> values_at(std::int32_t y, std::int32_t rx) {
  Gamepad pad = held();
  pad.take(event(EV_ABS, ABS_Y, y, kStart), kStart);
  pad.take(event(EV_ABS, ABS_RX, rx, kStart), kStart);
  return pad.wish(kStart).value_or(std::vector<float>{});
}

TEST(Gamepad, MiddleIsWhenAbsentAndEndsAreTheLimits) {
  EXPECT_EQ(values_at(0, 127), (std::vector{0.0F, 0.7F}));
  EXPECT_EQ(values_at(-32768, 255), (std::vector{std::nextafter(0.3F, 0.0F), 2.0F})) << "0.3F is more than 0.3";
  EXPECT_EQ(values_at(32767, 0), (std::vector{-0.5F, -1.0F}));
  const std::vector<float> half = values_at(-17695, 200);  // 0.54 and 0.5686 of the way: 0.5 and 0.5311 beyond 8 %
  ASSERT_EQ(half.size(), 2U);
  EXPECT_NEAR(half[0], 0.15, 1e-4);
  EXPECT_NEAR(half[1], 0.7 + 0.5311 * 1.3, 1e-3);
  EXPECT_EQ(values_at(2600, 120), (std::vector{0.0F, 0.7F})) << "inside 8 %: the middle";
}

TEST(Gamepad, SaysNothingWithoutItsButton) {
  Gamepad pad(mapping());
  pad.take(event(EV_ABS, ABS_Y, -32768, kStart), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "not pressed";
  pad.take(event(EV_KEY, BTN_TR, 1, kStart), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "another button";
  pad.take(event(EV_KEY, BTN_TL, 2, kStart), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "a repeat is no press";
  pad.take(event(EV_KEY, BTN_TL, 1, kStart), kStart);
  EXPECT_TRUE(pad.wish(kStart));
  pad.take(event(EV_KEY, BTN_TL, 0, kStart), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "released";
}

TEST(Gamepad, AFrozenOneIsNotBelievedUntilItSpeaks) {
  Gamepad pad = held();
  EXPECT_TRUE(pad.wish(kStart + milliseconds(200)));
  EXPECT_FALSE(pad.wish(kStart + milliseconds(201)));
  const MonoTime again = kStart + seconds(5);
  pad.take(event(EV_ABS, ABS_Y, 5, again), again);
  EXPECT_TRUE(pad.wish(again));
}

TEST(Gamepad, ALateOneIsNotBelieved) {
  Gamepad pad(mapping());
  const MonoTime now = kStart + milliseconds(201);
  pad.take(event(EV_KEY, BTN_TL, 1, kStart), now);
  EXPECT_FALSE(pad.wish(now)) << "pressed 201 ms ago, as far as anybody knows";
}

TEST(Gamepad, ALyingOneHasToBePressedAnew) {
  for (const std::int32_t lie : {-32769, 32768}) {
    Gamepad pad = held();
    pad.take(event(EV_ABS, ABS_Y, lie, kStart), kStart);
    EXPECT_FALSE(pad.wish(kStart)) << "outside its own range";
    pad.take(event(EV_KEY, BTN_TL, 1, kStart), kStart);
    EXPECT_EQ(pad.wish(kStart), (std::vector{0.0F, 0.7F})) << "and what it said is forgotten";
  }
  Gamepad pad = held();
  pad.take(event(EV_ABS, ABS_Y, 1, kStart + seconds(100)), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "from the future";
  EXPECT_FALSE(pad.wish(kStart + seconds(99)));
  pad.take(event(EV_KEY, BTN_TL, 1, kStart + seconds(100)), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "pressed in the future";
}

TEST(Gamepad, AfterLostEventsItHasToBePressedAnew) {
  Gamepad pad = held();
  pad.take(event(EV_ABS, ABS_Y, -32768, kStart), kStart);
  pad.take(event(EV_SYN, SYN_DROPPED, 0, kStart), kStart);
  EXPECT_FALSE(pad.wish(kStart));
  pad.take(event(EV_KEY, BTN_TL, 1, kStart), kStart);
  EXPECT_FALSE(pad.wish(kStart)) << "the rest of a report that lost its beginning";
  pad.take(event(EV_SYN, SYN_REPORT, 0, kStart), kStart);
  pad.take(event(EV_KEY, BTN_TL, 1, kStart), kStart);
  EXPECT_EQ(pad.wish(kStart), (std::vector{0.0F, 0.7F})) << "where the stick is, nobody knows";
}

TEST(Gamepad, NoEventLeadsOutOfTheLimits) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    std::mt19937_64 random(seed);
    const auto drawn = [&random](std::int64_t low, std::int64_t high) {
      return low + static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(high - low + 1));
    };
    GamepadMapping made = mapping();
    for (std::size_t i = 0; i < made.sticks.size(); ++i) {
      made.sticks[i].minimum = static_cast<std::int32_t>(drawn(-40000, 0));
      made.sticks[i].maximum = static_cast<std::int32_t>(drawn(1, 40000));
      made.limits.minimum[i] = -static_cast<double>(drawn(0, 10'000)) / 3000;
      made.limits.maximum[i] = static_cast<double>(drawn(0, 10'000)) / 3000;
      made.limits.when_absent[i] = made.limits.maximum[i] / 3;
    }
    Gamepad pad(made);
    MonoTime now = kStart;
    for (int i = 0; i < 500; ++i) {
      now = now + milliseconds(drawn(0, 20));
      const auto type = static_cast<std::uint16_t>(drawn(EV_SYN, EV_ABS));
      constexpr std::uint16_t kCodes[] = {SYN_REPORT, BTN_TL, ABS_Y, ABS_RX, SYN_DROPPED};
      const std::int64_t value = type == EV_KEY ? drawn(0, 8) % 3 : drawn(-50'000, 50'000);
      pad.take(event(type, kCodes[drawn(0, i % 50 == 0 ? 4 : 3)], static_cast<std::int32_t>(value), now), now);
      const auto wish = pad.wish(now);
      for (std::size_t v = 0; wish && v < wish->size(); ++v) {
        ASSERT_GE((*wish)[v], made.limits.minimum[v]) << "seed " << seed;
        ASSERT_LE((*wish)[v], made.limits.maximum[v]) << "seed " << seed;
      }
    }
  }
}

}  // namespace
}  // namespace takt::sensors
