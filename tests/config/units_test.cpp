// SPDX-License-Identifier: Apache-2.0
// Goal: quantities keep their value on the way in and out. Method: a table, and the round trip of random doubles.
#include "config/units.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>

namespace takt::config {
namespace {

TEST(Units, EveryUnitIsReadInItsBase) {
  for (const Unit& unit : units()) {
    const auto value = parse_quantity("2.5 " + std::string(unit.symbol), unit.dimension);
    ASSERT_TRUE(value.has_value()) << unit.symbol;
    EXPECT_EQ(*value, 2.5 * unit.factor) << unit.symbol;
  }
}

// One way for robot files and command lines.
TEST(Units, TheSpaceBeforeTheUnitMayBeLeftOut) {
  for (const Unit& unit : units())
    for (const char* number : {"2.5", "-0.5", "1e3", "25e-1", "7"}) {
      const std::string symbol(unit.symbol);
      const auto apart = parse_quantity(std::string(number) + ' ' + symbol, unit.dimension);
      ASSERT_TRUE(apart) << number << ' ' << symbol << ": " << apart.error();
      EXPECT_EQ(parse_quantity(number + symbol, unit.dimension), apart) << number << symbol;
    }
  EXPECT_EQ(*parse_quantity("250ms", Dimension::time), 250e6);
  EXPECT_DOUBLE_EQ(*parse_quantity("30deg", Dimension::angle), std::acos(-1.0) / 6);
}

TEST(Units, WhatIsNoQuantityIsRefused) {
  for (const char* text : {"", "-", "ms", "250", "250  ms", " 250ms", "250ms ", "250msx", "0250ms", "infs", "nan s",
                           "+1s", "0x1Fs", "1_0ms", "1,5s", "250 deg", "1e999s"})
    EXPECT_FALSE(parse_quantity(text, Dimension::time)) << text;
}

// The one unit that a complaint names is copied unread: 8.6 deg became 8.6 rad.
TEST(Units, ANumberWithoutAUnitIsOfferedEveryUsualOne) {
  const auto complaint = [](std::string_view text, Dimension dimension) {
    return parse_quantity(text, dimension).error();
  };
  EXPECT_EQ(complaint("8.6", Dimension::angle), "8.6 has no unit; write `8.6 rad` or `8.6 deg`");
  EXPECT_EQ(complaint("0.15", Dimension::time), "0.15 has no unit; write `0.15 ms` or `0.15 s`");
  EXPECT_EQ(complaint("20", Dimension::length), "20 has no unit; write `20 m` or `20 mm`");
  EXPECT_EQ(complaint("500", Dimension::bit_rate),
            "500 has no unit; write `500 bit/s` or `500 kbit/s` or `500 Mbit/s`");
  EXPECT_EQ(complaint("12", Dimension::torque), "12 has no unit; write `12 Nm`") << "no other is read";
}

TEST(Units, DurationsUseTheLargestWholeUnit) {
  EXPECT_EQ(format_duration(seconds(2)), "2 s");
  EXPECT_EQ(format_duration(milliseconds(2500)), "2500 ms");
  EXPECT_EQ(format_duration(microseconds(100)), "100 us");
  EXPECT_EQ(format_duration({1}), "1 ns");
  EXPECT_EQ(format_duration({0}), "0 ms");
}

RC_GTEST_PROP(Units, FormattedQuantitiesReadBackToTheSameBits, ()) {
  const auto bits = *rc::gen::inRange<std::uint64_t>(0, ~std::uint64_t{0});
  const auto value = std::bit_cast<double>(bits);
  RC_PRE(std::isnormal(value));
  const auto read = parse_quantity(format_quantity(value, Dimension::torque), Dimension::torque);
  RC_ASSERT(read.has_value());
  RC_ASSERT(std::bit_cast<std::uint64_t>(*read) == bits);
}

}  // namespace
}  // namespace takt::config
