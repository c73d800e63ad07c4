// SPDX-License-Identifier: Apache-2.0
// Tables of where each element of a result comes from, for the operators that move elements.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/node.hpp"

namespace takt::onnx_engine {

// result[i] = in[from[i]]; the result is called `name`. Integers known at load stay known.
void rearrange(Builder& builder, const std::string& name, const Value& in, const Shape& shape,
               std::vector<std::uint32_t> from);

// Before a table of this many entries is made; refuses one that is too large.
void charge_table(Builder& builder, const Node& node, const Shape& shape);

// `source(index)` for every index of `shape`, in row-major order.
template <class Source>
std::vector<std::uint32_t> table_of(const Shape& shape, Source source) {
  std::vector<std::uint32_t> table(elements(shape));
  std::vector<std::int64_t> index(shape.size(), 0);
  for (std::uint32_t& entry : table) {
    entry = source(index);
    for (std::size_t d = shape.size(); d-- > 0;) {  // an odometer: the last dimension turns fastest
      if (++index[d] < shape[d]) break;
      index[d] = 0;
    }
  }
  return table;
}

}  // namespace takt::onnx_engine
