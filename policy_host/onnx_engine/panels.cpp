// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/panels.hpp"

#include <algorithm>
#include <cstring>

namespace takt::onnx_engine {

namespace {

// Registers of the compiler's own, so that one text serves every width of them.
using Narrow = float __attribute__((vector_size(32)));  // two registers where only SSE or NEON is there
using Wide = float __attribute__((vector_size(64)));

// What is multiplied: `rows` rows of `a` by all panels.
struct Product {
  const float* a;
  const float* packed;
  std::size_t rows, inner, columns;
  float* out;
};

// `row_count` rows by `panel_count` panels from column `first` on, in slices of `width` registers. Every element has a
// sum of its own, in ascending k, one rounding per product and one per addition: no register width changes a bit. That
// many sums at once hide the latency of the additions.
template <class Register, std::size_t row_count, std::size_t panel_count, std::size_t width>
[[gnu::always_inline]] inline void multiply_block(const Product& p, std::size_t row, std::size_t first) noexcept {
  constexpr std::size_t lanes = sizeof(Register) / sizeof(float);
  // Of the last panel, which may be wider than the matrix, no slice that is padding alone.
  for (std::size_t offset = 0; offset < panel_columns && first + offset < p.columns; offset += width * lanes) {
    Register sums[row_count][panel_count * width] = {};
    const float* a = p.a + row * p.inner;
    const float* panel = p.packed + first * p.inner + offset;
    for (std::size_t k = 0; k < p.inner; ++k, panel += panel_columns) {
      Register b[panel_count * width];
#pragma GCC unroll 16
      for (std::size_t i = 0; i < panel_count * width; ++i) {
        std::memcpy(&b[i], panel + i / width * p.inner * panel_columns + i % width * lanes, sizeof(Register));
      }
#pragma GCC unroll 16
      for (std::size_t r = 0; r < row_count; ++r) {
#pragma GCC unroll 16
        for (std::size_t i = 0; i < panel_count * width; ++i) sums[r][i] += a[r * p.inner + k] * b[i];
      }
    }
    // The last panel of a matrix is wider than what is left to write.
    for (std::size_t r = 0; r < row_count; ++r) {
      for (std::size_t i = 0; i < panel_count * width; ++i) {
        const std::size_t column = first + i / width * panel_columns + offset + i % width * lanes;
        if (column >= p.columns) continue;
        std::memcpy(p.out + (row + r) * p.columns + column, &sums[r][i],
                    std::min(p.columns - column, lanes) * sizeof(float));
      }
    }
  }
}

template <class Register>
[[gnu::always_inline]] inline void multiply(const Product& p) noexcept {
  constexpr std::size_t tile_rows = 4;
  constexpr std::size_t all = panel_columns * sizeof(float) / sizeof(Register);
  const std::size_t tiled = p.rows / tile_rows * tile_rows;
  for (std::size_t first = 0; first < p.columns; first += panel_columns) {
    for (std::size_t row = 0; row < tiled; row += tile_rows) multiply_block<Register, tile_rows, 1, 2>(p, row, first);
  }
  std::size_t first = 0;
  for (; first + panel_columns < p.columns; first += 2 * panel_columns) {
    for (std::size_t row = tiled; row < p.rows; ++row) multiply_block<Register, 1, 2, all>(p, row, first);
  }
  for (std::size_t row = tiled; first < p.columns && row < p.rows; ++row)
    multiply_block<Register, 1, 1, all>(p, row, first);
}

void multiply_anywhere(const float* a, const float* packed, std::size_t rows, std::size_t inner, std::size_t columns,
                       float* out) noexcept {
  multiply<Narrow>({a, packed, rows, inner, columns, out});
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void multiply_avx2(const float* a, const float* packed, std::size_t rows, std::size_t inner,
                                           std::size_t columns, float* out) noexcept {
  multiply<Narrow>({a, packed, rows, inner, columns, out});
}

[[gnu::target("avx512f")]] void multiply_avx512(const float* a, const float* packed, std::size_t rows,
                                                std::size_t inner, std::size_t columns, float* out) noexcept {
  multiply<Wide>({a, packed, rows, inner, columns, out});
}
#endif

const MultiplyPanels widest = every_multiply_panels().back();

}  // namespace

std::vector<MultiplyPanels> every_multiply_panels() {
  std::vector<MultiplyPanels> known{multiply_anywhere};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) known.push_back(multiply_avx2);
  if (__builtin_cpu_supports("avx512f")) known.push_back(multiply_avx512);
#endif
  return known;
}

std::size_t packed_size(std::size_t inner, std::size_t columns) noexcept {
  return inner * ((columns + panel_columns - 1) / panel_columns) * panel_columns;
}

void pack_panels(const float* from, std::size_t inner, std::size_t columns, std::size_t row_step,
                 std::size_t column_step, float* packed) noexcept {
  for (std::size_t first = 0; first < columns; first += panel_columns) {
    const std::size_t used = std::min(panel_columns, columns - first);
    for (std::size_t k = 0; k < inner; ++k, packed += panel_columns) {
      const float* row = from + k * row_step + first * column_step;
      for (std::size_t c = 0; c < used; ++c) packed[c] = row[c * column_step];
      std::fill(packed + used, packed + panel_columns, 0.0F);
    }
  }
}

void multiply_panels(const float* a, const float* packed, std::size_t rows, std::size_t inner, std::size_t columns,
                     float* out) noexcept {
  widest(a, packed, rows, inner, columns, out);
}

}  // namespace takt::onnx_engine
