// SPDX-License-Identifier: Apache-2.0
// NumPy broadcasting of two operands, resolved at load into rows that a plain loop can run.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "policy_host/onnx_engine/tensor.hpp"

namespace takt::onnx_engine {

// The result is `rows` stretches of `length` elements. In a row each operand either advances with the result or stays.
struct Broadcast {
  Shape shape;
  std::size_t length = 1;
  bool left_advances = true;
  bool right_advances = true;
  std::vector<std::uint32_t> left_offsets;  // of each row's first element
  std::vector<std::uint32_t> right_offsets;
};

// Nothing when the shapes do not broadcast or the result, or the tables to reach it, would be too large to hold.
std::optional<Shape> broadcast_shape(const Shape& left, const Shape& right);
std::optional<Broadcast> plan_broadcast(const Shape& left, const Shape& right);

}  // namespace takt::onnx_engine
