// SPDX-License-Identifier: Apache-2.0
// Walks through row-major tensors in another order: the offsets are worked out at load, a run only follows them.
#pragma once

#include <cstdint>
#include <vector>

#include "policy_host/onnx_engine/tensor.hpp"

namespace takt::onnx_engine {

// Distance in elements between neighbours along each dimension of a dense tensor.
std::vector<std::int64_t> row_major_steps(const Shape& shape);

// Offset of every element of a walk of this shape, in row-major order: first + sum of index[d] * steps[d].
std::vector<std::uint32_t> strided_offsets(const Shape& shape, const std::vector<std::int64_t>& steps,
                                           std::int64_t first);

}  // namespace takt::onnx_engine
