// SPDX-License-Identifier: Apache-2.0
// Goal: no byte of a stranger's text is obeyed by a terminal, and readable text stays as it is. Method: control
// characters of each kind alone, broken and overlong UTF-8; then every pair of bytes, of which none may leave a
// control.
#include "config/printable.hpp"

#include <gtest/gtest.h>

namespace takt::config {
namespace {

TEST(Printable, ReadableTextStays) {
  for (const char* text : {"", "arm6", "two\nlines",
                           "Gelenk 3 \xC3\xBC"
                           "ber 80 \xC2\xB0"
                           "C",
                           "\xE2\x82\xAC", "\xF0\x9F\xA4\x96"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, WhatATerminalObeysIsSpeltOut) {
  EXPECT_EQ(printable("\x1b[2J"), "\\x1b[2J");
  EXPECT_EQ(printable("a\rb\tc\x7f"), "a\\x0db\\x09c\\x7f");
  EXPECT_EQ(printable("\xC2\x9b"
                      "2J"),
            "\\xc2\\x9b2J")
      << "C1: CSI in one character";
  EXPECT_EQ(printable("\x9b"), "\\x9b");
  EXPECT_EQ(printable("\xC0\x9b"), "\\xc0\\x9b") << "overlong";
  EXPECT_EQ(printable("\xE0\x80\x9b"), "\\xe0\\x80\\x9b") << "overlong";
  EXPECT_EQ(printable("\xED\xA0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(printable("\xE2\x82"), "\\xe2\\x82") << "cut off";
  EXPECT_EQ(printable(std::string_view("\0", 1)), "\\x00");
}

TEST(Printable, NoPairOfBytesLeavesAControl) {
  for (int first = 0; first < 256; ++first)
    for (int second = 0; second < 256; ++second) {
      const std::string shown = printable(std::string{static_cast<char>(first), static_cast<char>(second)});
      EXPECT_EQ(printable(shown), shown) << first << ' ' << second;
      for (const char c : shown)
        EXPECT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 0x20) << first << ' ' << second;
    }
}

}  // namespace
}  // namespace takt::config
