// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/packed_block.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <new>
#include <stdexcept>

namespace takt::evidence {
namespace {

constexpr std::int32_t kMissing = -32768;
constexpr std::int32_t kMost = 32767;
constexpr double kTimesPerSecond = 1e5;

struct Quantisation {
  double offset = 0, scale = 1;
};

Quantisation quantisation_of(const SampleColumn& column) {
  if (column.whole) return {};
  double least = 0, most = 0;
  bool empty = true;
  for (const float value : column.values) {
    if (!std::isfinite(value)) continue;
    least = empty ? static_cast<double>(value) : std::min(least, static_cast<double>(value));
    most = empty ? static_cast<double>(value) : std::max(most, static_cast<double>(value));
    empty = false;
  }
  const double scale = (most - least) / (2.0 * kMost);
  return {(least + most) / 2, scale > 0 ? scale : 1};
}

std::int32_t quantised(float value, const Quantisation& by) {
  if (!std::isfinite(value)) return kMissing;
  const double steps = std::round((static_cast<double>(value) - by.offset) / by.scale);
  return static_cast<std::int32_t>(std::clamp(steps, -double{kMost}, double{kMost}));
}

// Differences of successive integers, `planes` low bytes of each, byte planes one behind the other.
template <class IntegerAt>
void put_planes(std::string& out, std::size_t rows, std::size_t planes, const IntegerAt& integer_at) {
  const std::size_t start = out.size();
  out.resize(start + rows * planes);
  std::uint32_t before = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    const auto integer = static_cast<std::uint32_t>(integer_at(row));
    const std::uint32_t difference = integer - before;
    before = integer;
    for (std::size_t plane = 0; plane < planes; ++plane) {
      out[start + plane * rows + row] = static_cast<char>((difference >> (8 * plane)) & 0xFFU);
    }
  }
}

std::string deflated(const std::string& content) {
  uLongf size = compressBound(content.size());
  std::string out(size, '\0');
  // bytes as zlib's own type
  auto* to = reinterpret_cast<Bytef*>(out.data());
  const auto* from = reinterpret_cast<const Bytef*>(content.data());
  if (compress2(to, &size, from, content.size(), Z_DEFAULT_COMPRESSION) != Z_OK) throw std::bad_alloc();
  out.resize(size);
  return out;
}

}  // namespace

std::string base64_of(const std::string& bytes) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8U | (k < have ? static_cast<unsigned char>(bytes[at + k]) : 0U);
    }
    for (std::size_t digit = 0; digit < 4; ++digit) {
      text += digit <= have ? kDigits[(bits >> (18 - 6 * digit)) & 63U] : '=';
    }
  }
  return text;
}

PackedBlock pack(const SampleBlock& block) {
  std::string content;
  nlohmann::ordered_json columns = nlohmann::ordered_json::array();
  put_planes(content, block.rows(), 4,
             [&](std::size_t row) { return std::llround(block.at_s[row] * kTimesPerSecond); });
  for (const SampleColumn& column : block.columns) {
    const Quantisation by = quantisation_of(column);
    put_planes(content, block.rows(), 2, [&](std::size_t row) { return quantised(column.values[row], by); });
    columns.push_back({column.name, by.offset, by.scale});
  }
  return {{{"rows", block.rows()}, {"bucket_ticks", block.bucket_ticks}, {"columns", columns}},
          base64_of(deflated(content))};
}

}  // namespace takt::evidence
