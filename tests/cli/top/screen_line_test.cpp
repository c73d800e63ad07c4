// SPDX-License-Identifier: Apache-2.0
// Goal: widths are counted in cells, not bytes, and clipping never cuts a character. Method: multi-byte glyphs.
#include "cli/top/screen_line.hpp"

#include <gtest/gtest.h>

namespace takt::monitor::top {
namespace {

TEST(ScreenLine, CountsCharacters) {
  EXPECT_EQ(cells("abc"), 3U);
  EXPECT_EQ(cells("▁▂▃"), 3U);
  EXPECT_EQ(first_cells("a▁b", 2), "a▁");
  EXPECT_EQ(first_cells("a▁", 9), "a▁");
  EXPECT_EQ(first_cells("▁", 0), "");
}

TEST(ScreenLine, ToFillsUpOrLeavesOneBlank) {
  Line line;
  line.to(0).add("ab").to(4).add("c").to(2).add("d");
  EXPECT_EQ(line.text(), "ab  c d");
}

TEST(ScreenLine, ClipCutsAcrossPieces) {
  Line line;
  line.add("▁▂", Style::alarm).add("▃▄", Style::good).add("x");
  line.clip(3);
  EXPECT_EQ(line.text(), "▁▂▃");
  ASSERT_EQ(line.pieces().size(), 2U);
  EXPECT_EQ(line.pieces()[1].style, Style::good);
}

}  // namespace
}  // namespace takt::monitor::top
