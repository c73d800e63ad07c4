// SPDX-License-Identifier: Apache-2.0
// A function of one element, in whole registers.
#pragma once

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/lanes.hpp"
#include "policy_host/onnx_engine/node.hpp"

namespace takt::onnx_engine {

// `function`: of a Lane, noexcept; it passes NaN on.
template <class Function>
void build_unary(Builder& builder, const Node& node, Function function) {
  const Value& in = node.float_input(0);
  Value& out = builder.define_floats(node.output(), in.shape);
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, count = elements(in.shape), function]() noexcept {
    map_lanes(from, to, count, function);
  });
}

}  // namespace takt::onnx_engine
