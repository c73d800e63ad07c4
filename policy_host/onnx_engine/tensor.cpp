// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/tensor.hpp"

#include <algorithm>
#include <cstdlib>
#include <new>

namespace takt::onnx_engine {

std::int64_t checked_elements(const Shape& shape) noexcept {
  constexpr auto most = static_cast<std::int64_t>(max_model_bytes / sizeof(float));
  if (shape.size() > max_rank) return -1;
  std::int64_t count = 1;
  bool empty = false;
  for (const std::int64_t dimension : shape) {
    if (dimension < 0) return -1;
    if (dimension == 0) {
      empty = true;
      continue;
    }
    if (dimension > most / count) return -1;
    count *= dimension;
  }
  return empty ? 0 : count;
}

std::size_t elements(const Shape& shape) noexcept {
  return elements_between(shape, 0, shape.size());
}

std::size_t elements_between(const Shape& shape, std::size_t first, std::size_t last) noexcept {
  std::size_t count = 1;
  for (std::size_t i = first; i < last; ++i) count *= static_cast<std::size_t>(shape[i]);
  return count;
}

std::string to_text(const Shape& shape) {
  std::string text = "[";
  for (const std::int64_t dimension : shape) {
    if (text.size() > 1) text += ", ";
    text += std::to_string(dimension);
  }
  return text + "]";
}

void FreeFloats::operator()(float* floats) const noexcept {
  std::free(floats);
}

FloatBuffer allocate_floats(std::size_t count) {
  constexpr std::size_t alignment = 64;
  const std::size_t bytes = std::max<std::size_t>(1, (count * sizeof(float) + alignment - 1) / alignment) * alignment;
  auto* floats = static_cast<float*>(std::aligned_alloc(alignment, bytes));
  if (floats == nullptr) throw std::bad_alloc();
  std::fill_n(floats, bytes / sizeof(float), 0.0F);
  return FloatBuffer(floats);
}

}  // namespace takt::onnx_engine
