#include "policy_host/onnx/panels.hpp"

#include <algorithm>
#include <cstring>

#include "policy_host/onnx/lanes.hpp"

namespace takt::onnx_engine {

namespace {

constexpr std::size_t lane_width = Lane::SizeAtCompileTime;
constexpr std::size_t lanes_per_panel = panel_columns / lane_width;
constexpr std::size_t tile_rows = 4;

// A lane's leading `count` elements: the last panel of a matrix is wider than what is left to write.
void store_leading(const Lane& lane, float* to, std::size_t count) noexcept {
  std::memcpy(to, lane.data(), std::min(count, lane_width) * sizeof(float));
}

// One row against one panel: four independent lanes hide the latency of the additions.
void multiply_row(const float* a, const float* panel, std::size_t inner, std::size_t columns, float* out) noexcept {
  Lane s0 = Lane::Zero();
  Lane s1 = Lane::Zero();
  Lane s2 = Lane::Zero();
  Lane s3 = Lane::Zero();
  for (std::size_t k = 0; k < inner; ++k, panel += panel_columns) {
    const float x = a[k];
    s0 += x * Lane::Map(panel);
    s1 += x * Lane::Map(panel + lane_width);
    s2 += x * Lane::Map(panel + 2 * lane_width);
    s3 += x * Lane::Map(panel + 3 * lane_width);
  }
  const Lane* sums[lanes_per_panel] = {&s0, &s1, &s2, &s3};
  for (std::size_t l = 0; l * lane_width < columns; ++l) {
    store_leading(*sums[l], out + l * lane_width, columns - l * lane_width);
  }
}

// Four rows against one lane of a panel: the panel is read once for four rows.
void multiply_tile(const float* a, const float* panel, std::size_t inner, std::size_t columns, std::size_t out_step,
                   float* out) noexcept {
  Lane s0 = Lane::Zero();
  Lane s1 = Lane::Zero();
  Lane s2 = Lane::Zero();
  Lane s3 = Lane::Zero();
  for (std::size_t k = 0; k < inner; ++k, panel += panel_columns) {
    const Lane b = Lane::Map(panel);
    s0 += a[k] * b;
    s1 += a[inner + k] * b;
    s2 += a[2 * inner + k] * b;
    s3 += a[3 * inner + k] * b;
  }
  store_leading(s0, out, columns);
  store_leading(s1, out + out_step, columns);
  store_leading(s2, out + 2 * out_step, columns);
  store_leading(s3, out + 3 * out_step, columns);
}

}  // namespace

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
  const std::size_t tiled = rows / tile_rows * tile_rows;
  for (std::size_t first = 0; first < columns; first += panel_columns, packed += inner * panel_columns) {
    const std::size_t used = std::min(panel_columns, columns - first);
    for (std::size_t r = 0; r < tiled; r += tile_rows) {
      for (std::size_t c = 0; c < used; c += lane_width) {
        multiply_tile(a + r * inner, packed + c, inner, used - c, columns, out + r * columns + first + c);
      }
    }
    for (std::size_t r = tiled; r < rows; ++r) {
      multiply_row(a + r * inner, packed, inner, used, out + r * columns + first);
    }
  }
}

}  // namespace takt::onnx_engine
