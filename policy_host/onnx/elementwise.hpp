// Binary element-wise arithmetic for the operators that end in one (Gemm adds its C this way).
#pragma once

#include "policy_host/onnx/builder.hpp"
#include "policy_host/onnx/node.hpp"

namespace takt::onnx_engine {

// target += source on every run, source broadcast to the target's shape; refuses a source that would enlarge it.
void add_in_place(Builder& builder, const Node& node, const Value& target, const Value& source);

}  // namespace takt::onnx_engine
