// SPDX-License-Identifier: Apache-2.0
// Shapes and storage of the engine's tensors: row-major, every dimension known once a model is loaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace takt::onnx_engine {

using Shape = std::vector<std::int64_t>;

// One model may not hold more than this, weights, activations and index tables together.
inline constexpr std::size_t max_model_bytes = std::size_t{1} << 30;
inline constexpr std::size_t max_rank = 8;

// Number of elements; -1 when a dimension is negative, the rank exceeds max_rank, or the product is more than a model
// may hold.
std::int64_t checked_elements(const Shape& shape) noexcept;
// The same for a shape that has passed checked_elements.
std::size_t elements(const Shape& shape) noexcept;
// Product of dimensions [first, last).
std::size_t elements_between(const Shape& shape, std::size_t first, std::size_t last) noexcept;

std::string to_text(const Shape& shape);  // "[1, 48]"

// Zeroed floats on a 64-byte boundary, so that where a tensor lies never depends on the allocator's mood.
struct FreeFloats {
  void operator()(float* floats) const noexcept;
};
using FloatBuffer = std::unique_ptr<float[], FreeFloats>;
FloatBuffer allocate_floats(std::size_t count);

}  // namespace takt::onnx_engine
