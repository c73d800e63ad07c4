// SPDX-License-Identifier: Apache-2.0
// Tensors whose elements are no float32, as ONNX Runtime stores them, to and from the floats of the engine's boundary.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace takt::onnx_runtime {

// ONNX's number of an element type (TensorProto.DataType).
inline constexpr int kFloat32 = 1;

// Bytes of one element; 0: no type of numbers (text, complex numbers, four bits).
std::size_t stored_bytes(int element) noexcept;

// `to` has as many elements as `from`. Whole numbers are cut, and what is not 0 is true. False: NaN, or a number that
// the type does not hold, stands where only whole numbers or truths do; `to` is unspecified then.
bool store(std::span<const float> from, int element, std::span<std::byte> to) noexcept;

// Rounded to the nearest float32; truths are 0 and 1.
void read(std::span<const std::byte> from, int element, std::span<float> to) noexcept;

}  // namespace takt::onnx_runtime
