// SPDX-License-Identifier: Apache-2.0
// Goal: the byte layout is CDR's, and a reader survives any input. Method: annotated bytes; truncation at every length.
#include "monitor/record/cdr.hpp"

#include <gtest/gtest.h>

#include <array>

namespace takt::monitor {
namespace {

Bytes octets(std::initializer_list<int> values) {
  Bytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

TEST(Cdr, AlignsEveryPrimitiveToItsSize) {
  CdrWriter out;
  out.put(std::uint8_t{0x11});
  out.put(std::uint32_t{0x22});
  out.put(std::uint8_t{0x33});
  out.put(std::int64_t{-1});
  EXPECT_EQ(out.bytes(), octets({0,    1,   0,   0,                       // encapsulation: CDR, little-endian
                                 0x11, 0,   0,   0,   0x22, 0,   0,   0,  // uint8, padding, uint32
                                 0x33, 0,   0,   0,   0,    0,   0,   0,  // uint8, padding to 8
                                 255,  255, 255, 255, 255,  255, 255, 255}));
}

TEST(Cdr, StringsCarryTheirFinalZero) {
  CdrWriter out;
  out.put_string("hi");
  out.put(std::uint16_t{7});
  EXPECT_EQ(out.bytes(), octets({0, 1, 0, 0, 3, 0, 0, 0, 'h', 'i', 0, 0, 7, 0}));
}

TEST(Cdr, ReadsBackWhatItWroteAndNothingFromAnyShorterMessage) {
  CdrWriter out;
  out.put(1.5F);
  out.put_string("name");
  out.put_octets(octets({1, 2, 3}));
  out.put(std::uint64_t{42});
  const auto read = [](std::span<const std::byte> message) {
    CdrReader in(message);
    const bool equal = in.get<float>() == 1.5F && in.get_string() == "name" && in.get_octets().size() == 3 &&
                       in.get<std::uint64_t>() == 42;
    return equal && in.ok();
  };
  EXPECT_TRUE(read(out.bytes()));
  for (std::size_t length = 0; length < out.bytes().size(); ++length) {
    EXPECT_FALSE(read(std::span(out.bytes()).first(length))) << length;
  }
}

TEST(Cdr, AColumnComesBackIntoRowsAndNothingOfACutOne) {
  struct Row {
    std::uint16_t value = 9;
    std::uint16_t other = 7;
  };
  CdrWriter out;
  out.put(std::uint8_t{1});
  for (std::uint16_t value = 3; value < 6; ++value) out.put(value);
  std::array<Row, 3> rows{};
  CdrReader in(out.bytes());
  EXPECT_EQ(in.get<std::uint8_t>(), 1);
  in.get_column(rows.data(), sizeof(Row), sizeof rows[0].value, rows.size());
  EXPECT_TRUE(in.ok());
  for (std::size_t row = 0; row < rows.size(); ++row) {
    EXPECT_EQ(rows[row].value, 3 + row);
    EXPECT_EQ(rows[row].other, 7) << "only the column is written";
  }
  CdrReader cut(std::span(out.bytes()).first(out.bytes().size() - 1));
  (void)cut.get<std::uint8_t>();
  cut.get_column(rows.data(), sizeof(Row), sizeof rows[0].value, rows.size());
  EXPECT_FALSE(cut.ok());
  for (const Row& row : rows) EXPECT_EQ(row.value, 0);
}

TEST(Cdr, AHostileCountIsRefused) {
  CdrWriter out;
  out.put(std::uint32_t{0xFFFF'FFFF});
  CdrReader count(out.bytes());
  EXPECT_EQ(count.get_count(64), 0U);
  EXPECT_FALSE(count.ok());
  CdrReader text(out.bytes());
  EXPECT_TRUE(text.get_string().empty());
  EXPECT_FALSE(text.ok());
}

}  // namespace
}  // namespace takt::monitor
