// SPDX-License-Identifier: Apache-2.0
// One copy of equal constants for all models of this process, so that networks with the same weights (a policy and the
// fallback made of the same file) find them in the processor's caches.
//
// Equal means bit for bit; what is shared is never written again and lives as long as a model that uses it. Thread
// rule: any thread; at load only.
#pragma once

#include <cstddef>
#include <memory>

#include "policy_host/onnx_engine/tensor.hpp"

namespace takt::onnx_engine {

using SharedFloats = std::shared_ptr<const float[]>;

// `floats`, or in its place an equal array of the same `count` that a living model has already.
SharedFloats share_constant(FloatBuffer floats, std::size_t count);

}  // namespace takt::onnx_engine
