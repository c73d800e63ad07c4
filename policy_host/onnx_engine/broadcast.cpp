// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/broadcast.hpp"

#include <algorithm>
#include <utility>

#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

namespace {

Shape left_padded(const Shape& shape, std::size_t rank) {
  Shape padded(rank - shape.size(), 1);
  padded.insert(padded.end(), shape.begin(), shape.end());
  return padded;
}

std::vector<std::uint32_t> row_offsets(const Shape& operand, const Shape& result, std::size_t outer) {
  std::vector<std::int64_t> steps = row_major_steps(operand);
  for (std::size_t d = 0; d < outer; ++d) {
    if (operand[d] == 1) steps[d] = 0;
  }
  steps.resize(outer);
  return strided_offsets({result.begin(), result.begin() + static_cast<std::ptrdiff_t>(outer)}, steps, 0);
}

}  // namespace

std::optional<Shape> broadcast_shape(const Shape& left, const Shape& right) {
  const std::size_t rank = std::max(left.size(), right.size());
  const Shape a = left_padded(left, rank);
  const Shape b = left_padded(right, rank);
  Shape shape;
  for (std::size_t d = 0; d < rank; ++d) {
    if (a[d] != b[d] && a[d] != 1 && b[d] != 1) return std::nullopt;
    shape.push_back(a[d] == 1 ? b[d] : a[d]);
  }
  if (checked_elements(shape) < 0) return std::nullopt;
  return shape;
}

std::optional<Broadcast> plan_broadcast(const Shape& left, const Shape& right) {
  std::optional<Shape> shape = broadcast_shape(left, right);
  if (!shape) return std::nullopt;
  Broadcast plan;
  plan.shape = *std::move(shape);
  const std::size_t rank = plan.shape.size();
  const Shape a = left_padded(left, rank);
  const Shape b = left_padded(right, rank);

  // The longest run of trailing dimensions in which each operand behaves in one way. Dimensions of 1 fit any way.
  std::size_t outer = rank;
  std::optional<bool> left_advances;
  std::optional<bool> right_advances;
  while (outer > 0) {
    const std::size_t d = outer - 1;
    if (plan.shape[d] != 1) {
      const bool a_here = a[d] != 1;
      const bool b_here = b[d] != 1;
      if (left_advances.value_or(a_here) != a_here || right_advances.value_or(b_here) != b_here) break;
      left_advances = a_here;
      right_advances = b_here;
    }
    outer = d;
  }
  plan.left_advances = left_advances.value_or(true);
  plan.right_advances = right_advances.value_or(true);
  plan.length = elements_between(plan.shape, outer, rank);
  if (elements_between(plan.shape, 0, outer) > max_model_bytes / (2 * sizeof(std::uint32_t))) return std::nullopt;
  plan.left_offsets = row_offsets(a, plan.shape, outer);
  plan.right_offsets = row_offsets(b, plan.shape, outer);
  return plan;
}

}  // namespace takt::onnx_engine
