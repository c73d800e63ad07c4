// SPDX-License-Identifier: Apache-2.0
// Binary element-wise arithmetic for the operators that end in one (Gemm adds its C this way).
#pragma once

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/node.hpp"

namespace takt::onnx_engine {

// target += source on every run, source broadcast to the target's shape; refuses a source that would enlarge it.
void add_in_place(Builder& builder, const Node& node, const Value& target, const Value& source);

// Integers, known or decided by an input, as floats whose type is float32 for as long as arithmetic goes on; refuses
// anything else.
Value as_live(Builder& builder, const Node& node, const Value& value);

}  // namespace takt::onnx_engine
