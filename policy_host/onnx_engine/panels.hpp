// SPDX-License-Identifier: Apache-2.0
// Matrix product in a fixed order of additions.
//
// The right-hand matrix is packed into panels of 32 columns, padded with zeros. Every element of the result is summed
// in ascending k from zero, one rounding per product and one per addition, whatever the number of rows and the width of
// the registers; so the bits do not depend on tiling, on cache sizes or on the machine. The widest registers that the
// processor has are used. (Eigen's own product chooses its blocking from the cache sizes it finds, and may allocate.)
#pragma once

#include <cstddef>
#include <vector>

namespace takt::onnx_engine {

inline constexpr std::size_t panel_columns = 32;

// Floats that pack_panels writes for a matrix of `inner` rows and `columns` columns.
std::size_t packed_size(std::size_t inner, std::size_t columns) noexcept;

// `row_step` and `column_step`: distance in elements between neighbours of the source, so that a transpose costs
// nothing.
void pack_panels(const float* from, std::size_t inner, std::size_t columns, std::size_t row_step,
                 std::size_t column_step, float* packed) noexcept;

// out[rows x columns] = a[rows x inner] * packed; dense row-major. `out` must not overlap `a`.
void multiply_panels(const float* a, const float* packed, std::size_t rows, std::size_t inner, std::size_t columns,
                     float* out) noexcept;

// Every version of it that this processor can run, the one that multiply_panels() uses last.
using MultiplyPanels = decltype(&multiply_panels);
std::vector<MultiplyPanels> every_multiply_panels();

}  // namespace takt::onnx_engine
