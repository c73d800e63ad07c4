// SPDX-License-Identifier: Apache-2.0
// Goal: nothing moves a robot by one slip of a finger, and a stop needs one key only. Method: keys pressed by hand with
// a clock of the test's own; what terminals send for arrows and other special keys.
#include "cli/top/keys.hpp"

#include <gtest/gtest.h>

namespace takt::monitor::top {
namespace {

constexpr MonoTime kNow{5'000'000'000'000};

TEST(Keys, EachKeyHasItsWish) {
  Keys keys(6);
  EXPECT_EQ(keys.press('q', kNow), Wish::quit);
  EXPECT_EQ(keys.press('s', kNow), Wish::stop);
  EXPECT_EQ(keys.press('r', kNow), Wish::reset);
  EXPECT_EQ(keys.press('m', kNow), Wish::mark);
  EXPECT_EQ(keys.press('p', kNow), Wish::snapshot);
  for (const char other : {'x', 'y', 'A', '\r', '\0'}) EXPECT_EQ(keys.press(other, kNow), std::nullopt) << other;
}

TEST(Keys, ArmingIsConfirmedOrForgotten) {
  Keys keys(6);
  EXPECT_EQ(keys.press('a', kNow), std::nullopt);
  EXPECT_TRUE(keys.prompt(kNow).confirms_arm);
  EXPECT_EQ(keys.press('y', kNow), Wish::arm);
  EXPECT_FALSE(keys.prompt(kNow).confirms_arm);

  (void)keys.press('a', kNow);
  EXPECT_EQ(keys.press('q', kNow), std::nullopt) << "any other key is a no, and nothing else";
  EXPECT_EQ(keys.press('y', kNow), std::nullopt);

  (void)keys.press('a', kNow);
  EXPECT_EQ(keys.press('y', kNow + kConfirmWithin + Duration{1}), std::nullopt) << "too late";
}

TEST(Keys, AStopIsHeardEvenWhileArmingIsAskedFor) {
  Keys keys(6);
  (void)keys.press('a', kNow);
  EXPECT_EQ(keys.press('s', kNow), Wish::stop);
  EXPECT_FALSE(keys.prompt(kNow).confirms_arm);
}

TEST(Keys, ScrollingStaysWithinTheJoints) {
  Keys keys(3);
  (void)keys.press('k', kNow);
  EXPECT_EQ(keys.prompt(kNow).scroll, 0U);
  for (int i = 0; i < 9; ++i) (void)keys.press('j', kNow);
  EXPECT_EQ(keys.prompt(kNow).scroll, 2U);
}

TEST(Keys, ANoteGoesAwayByItself) {
  Keys keys(3);
  keys.note("marked tick 7", false, kNow);
  EXPECT_EQ(keys.prompt(kNow + kNoteStays).note, "marked tick 7");
  EXPECT_EQ(keys.prompt(kNow + kNoteStays + Duration{1}).note, "");
}

TEST(KeysOf, SpecialKeysAreNoLetters) {
  EXPECT_EQ(keys_of("as"), "as");
  EXPECT_EQ(keys_of("\x1b[A\x1b[B\x1bOA\x1bOB"), "kjkj");
  EXPECT_EQ(keys_of("\x1b[15~q"), "q") << "F5, then q";
  EXPECT_EQ(keys_of("\x1b[1;5s"), "") << "a modified key ends with a letter that is none";
  EXPECT_EQ(keys_of("\x1bs"), "") << "Alt-s";
  EXPECT_EQ(keys_of("\x1b"), "");
  EXPECT_EQ(keys_of("\x1b[1;"), "") << "cut off";
}

}  // namespace
}  // namespace takt::monitor::top
