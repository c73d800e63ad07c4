// SPDX-License-Identifier: Apache-2.0
// Goal: the checksum is CRC-32C whichever implementation runs. Method: published vectors (RFC 3720, appendix B.4), the
// two implementations against each other over lengths around every lane boundary, and planted bit flips.
#include "executive/ipc/crc32c.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <numeric>
#include <string_view>
#include <vector>

namespace takt::ipc {
namespace {

std::vector<std::byte> counting_bytes(std::size_t count) {
  std::vector<std::byte> bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::byte>(i * 37 + i / 256);
  return bytes;
}

TEST(Crc32c, PublishedVectors) {
  const std::string_view digits = "123456789";
  EXPECT_EQ(crc32c(std::as_bytes(std::span(digits))), 0xE306'9283U);
  EXPECT_EQ(crc32c(std::vector(32, std::byte{0x00})), 0x8A91'36AAU);
  EXPECT_EQ(crc32c(std::vector(32, std::byte{0xFF})), 0x62A8'AB43U);
  std::vector<std::uint8_t> ascending(32);
  std::iota(ascending.begin(), ascending.end(), std::uint8_t{0});
  EXPECT_EQ(crc32c(std::as_bytes(std::span(ascending))), 0x46DD'794EU);
  EXPECT_EQ(crc32c({}), 0U);
}

// Lanes join from 96 bytes on and are cut at 3 x 1024 bytes: cover both, and blocks that follow one another.
TEST(Crc32c, InstructionAndTableAgreeAtEveryLength) {
  const std::vector<std::byte> bytes = counting_bytes(7000);
  for (std::size_t length = 0; length <= bytes.size(); ++length) {
    const auto part = std::span(bytes).first(length);
    ASSERT_EQ(crc32c(part, 0xDEAD'BEEF), crc32c_by_table(part, 0xDEAD'BEEF)) << "length " << length;
  }
}

TEST(Crc32c, PiecesChain) {
  EXPECT_TRUE(rc::check("crc(a + b) == crc(b, crc(a))", [](const std::vector<std::uint8_t>& data) {
    const auto bytes = std::as_bytes(std::span(data));
    const auto cut = *rc::gen::inRange<std::size_t>(0, data.size() + 1);
    RC_ASSERT(crc32c(bytes) == crc32c(bytes.subspan(cut), crc32c(bytes.first(cut))));
  }));
}

TEST(Crc32c, EveryFlippedBitShows) {
  std::vector<std::byte> bytes = counting_bytes(400);
  const std::uint32_t whole = crc32c(bytes);
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const auto flip = static_cast<std::byte>(1U << (bit % 8));
    bytes[bit / 8] ^= flip;
    EXPECT_NE(crc32c(bytes), whole) << "bit " << bit;
    bytes[bit / 8] ^= flip;
  }
}

}  // namespace
}  // namespace takt::ipc
