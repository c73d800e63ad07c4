// SPDX-License-Identifier: Apache-2.0
// Goal: what a page unpacks is what was packed, to half a step of 1/65534 of a column's range. Method: the format read
// back here from its description, base64 and byte planes by hand.
#include "evidence/review/report/packed_block.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <limits>

namespace takt::monitor {
namespace {

std::string from_base64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0, have = 0;
  for (const char digit : text) {
    if (digit == '=') break;
    bits = bits << 6U | static_cast<unsigned>(digits.find(digit));
    have += 6;
    if (have >= 8) bytes += static_cast<char>(bits >> (have -= 8) & 0xFFU);
  }
  return bytes;
}

std::string inflated(const std::string& content, std::size_t size) {
  std::string out(size, '\0');
  uLongf length = size;
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(out.data()), &length, reinterpret_cast<const Bytef*>(content.data()),
                       content.size()),
            Z_OK);
  EXPECT_EQ(length, size);
  return out;
}

// Integers out of differences in byte planes.
std::vector<std::uint32_t> unplaned(const std::string& bytes, std::size_t start, std::size_t rows, std::size_t planes) {
  std::vector<std::uint32_t> integers;
  std::uint32_t sum = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t plane = 0; plane < planes; ++plane) {
      sum += static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[start + plane * rows + row])) << (8 * plane);
    }
    integers.push_back(sum);
  }
  return integers;
}

evidence::SampleBlock wild_block() {
  evidence::SampleBlock block;
  block.columns = {{"smooth", false, {}}, {"whole", true, {}}, {"flat", false, {}}};
  for (std::size_t row = 0; row < 1000; ++row) {
    const auto x = static_cast<float>(row);
    block.at_s.push_back(30'000 + 0.00101 * static_cast<double>(row));  // beyond eight hours
    block.columns[0].values.push_back(row % 97 == 5 ? std::numeric_limits<float>::quiet_NaN() : 3 * std::sin(x));
    block.columns[1].values.push_back(static_cast<float>(row % 1024));
    block.columns[2].values.push_back(-7.25F);
  }
  return block;
}

TEST(PackedBlock, ComesBackAsItWas) {
  const evidence::SampleBlock block = wild_block();
  const evidence::PackedBlock packed = evidence::pack(block);
  const std::size_t rows = block.rows();
  ASSERT_EQ(packed.layout.at("rows"), rows);
  const std::string bytes = inflated(from_base64(packed.base64), rows * (4 + 2 * block.columns.size()));
  const auto times = unplaned(bytes, 0, rows, 4);
  for (std::size_t row = 0; row < rows; ++row) EXPECT_NEAR(times[row] * 1e-5, block.at_s[row], 0.51e-5);
  for (std::size_t index = 0; index < block.columns.size(); ++index) {
    const auto& layout = packed.layout.at("columns").at(index);
    EXPECT_EQ(layout.at(0), block.columns[index].name);
    const auto integers = unplaned(bytes, rows * (4 + 2 * index), rows, 2);
    for (std::size_t row = 0; row < rows; ++row) {
      const auto integer = static_cast<std::int16_t>(integers[row] & 0xFFFFU);
      const float value = block.columns[index].values[row];
      EXPECT_EQ(integer == -32768, std::isnan(value));
      if (std::isnan(value)) continue;
      const double scale = layout.at(2).get<double>();
      EXPECT_NEAR(layout.at(1).get<double>() + scale * integer, static_cast<double>(value), 0.51 * scale);
    }
  }
  EXPECT_EQ(packed.layout.at("columns").at(1).at(2), 1.0) << "integers stay exact";
}

TEST(PackedBlock, NothingIsPackedToo) {
  const evidence::PackedBlock packed = evidence::pack({});
  EXPECT_EQ(packed.layout.at("rows"), 0);
  EXPECT_FALSE(packed.base64.empty());
}

}  // namespace
}  // namespace takt::monitor
