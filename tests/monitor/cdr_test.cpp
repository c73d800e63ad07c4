// Goal: the byte layout is CDR's, and a reader survives any input. Method: annotated bytes; truncation at every length.
#include "monitor/cdr.hpp"

#include <gtest/gtest.h>

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
