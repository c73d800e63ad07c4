// SPDX-License-Identifier: Apache-2.0
// Goal: the drawings say what the slices say: which mode, whether the limit was passed, which part is how long. Method:
// slices and parts with known outlines, compared as text.
#include "cli/top/screen_plots.hpp"

#include <gtest/gtest.h>

namespace takt::monitor::top {
namespace {

constexpr Duration kLimit = milliseconds(80);

Slice aged(std::int64_t ms) {
  return {.ticks = 250, .mode = Mode::tracking, .age = milliseconds(ms)};
}

TEST(ModeBand, OneLetterPerSliceNewestAtTheRight) {
  const std::vector<Slice> history{{.ticks = 1, .mode = Mode::standby},
                                   {.ticks = 1, .mode = Mode::arming},
                                   {.ticks = 1, .mode = Mode::tracking},
                                   {.ticks = 0},
                                   {.ticks = 1, .mode = Mode::degraded, .marked = true},
                                   {.ticks = 1, .mode = Mode::damped_stop},
                                   {.ticks = 1, .mode = Mode::fault_latched}};
  EXPECT_EQ(mode_band(history, 9).text(), "  saT !SF");
  EXPECT_EQ(mode_band(history, 3).text(), "!SF");
}

TEST(AgePlot, WithOneRowTheLastLevelIsPastTheLimit) {
  const std::vector<Slice> history{aged(0), aged(1), aged(40), aged(80), aged(81), aged(10'000)};
  const auto unicode = age_plot(history, kLimit, 8, 1, Glyphs::unicode);
  ASSERT_EQ(unicode.size(), 1U);
  EXPECT_EQ(unicode[0].text(), "   ▁▄▇██");
  EXPECT_EQ(age_plot(history, kLimit, 8, 1, Glyphs::ascii)[0].text(), "   .-*##");
}

TEST(AgePlot, WithRoomTheLimitIsALine) {
  const std::vector<Slice> history{aged(10), aged(80), aged(200)};
  const auto lines = age_plot(history, kLimit, 5, 4, Glyphs::unicode);
  ASSERT_EQ(lines.size(), 4U);
  EXPECT_EQ(lines[0].text(), "╌╌╌╌█");
  EXPECT_EQ(lines[1].text(), "   ██");
  EXPECT_EQ(lines[2].text(), "   ██");
  EXPECT_EQ(lines[3].text(), "  ▃██");
}

TEST(AgePlot, WhatWasLateIsInAlarm) {
  std::vector<Slice> history{aged(40), aged(81), aged(40)};
  history[2].missed = true;
  const auto line = age_plot(history, kLimit, 3, 1, Glyphs::unicode)[0];
  EXPECT_EQ(line.pieces()[0].style, Style::plain);
  EXPECT_EQ(line.pieces()[1].style, Style::alarm);
  EXPECT_EQ(line.pieces()[2].style, Style::alarm);
}

TEST(StackedBar, PartsLieSideBySideAndEndAtTheWhole) {
  EXPECT_EQ(stacked_bar(std::vector{2.0, 1.0, 3.0}, 10, 10, Glyphs::ascii).text(), "ssqiii    ");
  EXPECT_EQ(stacked_bar(std::vector{8.0, 8.0}, 10, 10, Glyphs::unicode).text(), "████████▓▓");
  EXPECT_EQ(stacked_bar(std::vector{1.0}, 0, 4, Glyphs::ascii).text(), "    ") << "no whole, no bar";
}

}  // namespace
}  // namespace takt::monitor::top
