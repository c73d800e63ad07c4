// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

std::vector<std::int64_t> row_major_steps(const Shape& shape) {
  std::vector<std::int64_t> steps(shape.size(), 1);
  for (std::size_t d = shape.size(); d-- > 1;) steps[d - 1] = steps[d] * shape[d];
  return steps;
}

std::vector<std::uint32_t> strided_offsets(const Shape& shape, const std::vector<std::int64_t>& steps,
                                           std::int64_t first) {
  std::vector<std::uint32_t> offsets(elements(shape));
  std::vector<std::int64_t> index(shape.size(), 0);
  std::int64_t at = first;
  for (std::uint32_t& offset : offsets) {
    offset = static_cast<std::uint32_t>(at);
    for (std::size_t d = shape.size(); d-- > 0;) {  // an odometer: the last dimension turns fastest
      at += steps[d];
      if (++index[d] < shape[d]) break;
      at -= steps[d] * shape[d];
      index[d] = 0;
    }
  }
  return offsets;
}

}  // namespace takt::onnx_engine
