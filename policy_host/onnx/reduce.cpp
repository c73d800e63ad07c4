// SPDX-License-Identifier: Apache-2.0
// Reductions over some axes: ReduceMean, ReduceSum, ReduceL2. Sums run in ascending order.
#include <cmath>
#include <utility>

#include "policy_host/onnx/operators.hpp"
#include "policy_host/onnx/strides.hpp"

namespace takt::onnx_engine {

namespace {

// `add(sum, x)` for every element in turn, then `finish(sum, count)`.
template <class Add, class Finish>
void build_reduction(Builder& builder, const Node& node, Add add, Finish finish) {
  const Value& in = node.float_input(0);
  const std::vector<std::int64_t> axes = node.axes(1).value_or(std::vector<std::int64_t>{});
  const bool none = axes.empty() && node.integer("noop_with_empty_axes", 0) != 0;
  std::vector<bool> reduced(in.shape.size(), axes.empty() && !none);
  for (const std::int64_t axis : axes) reduced[node.axis(axis, in.shape.size())] = true;

  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  const bool keep = node.integer("keepdims", 1) != 0;
  Shape shape, kept, summed;
  std::vector<std::int64_t> kept_steps, summed_steps;
  for (std::size_t d = 0; d < reduced.size(); ++d) {
    (reduced[d] ? summed : kept).push_back(in.shape[d]);
    (reduced[d] ? summed_steps : kept_steps).push_back(steps[d]);
    if (!reduced[d] || keep) shape.push_back(reduced[d] ? 1 : in.shape[d]);
  }
  builder.charge((elements(kept) + elements(summed)) * sizeof(std::uint32_t));
  Value& out = builder.define_floats(node.output(), shape);
  builder.compute(out, {&in},
                  [from = in.floats, to = out.floats, starts = strided_offsets(kept, kept_steps, 0),
                   terms = strided_offsets(summed, summed_steps, 0), add, finish]() noexcept {
                    for (std::size_t i = 0; i < starts.size(); ++i) {
                      float sum = 0.0F;
                      for (const std::uint32_t term : terms) sum = add(sum, from[starts[i] + term]);
                      to[i] = finish(sum, static_cast<float>(terms.size()));
                    }
                  });
}

float plus(float sum, float x) noexcept {
  return sum + x;
}

}  // namespace

void build_reduce_sum(Builder& builder, const Node& node) {
  build_reduction(builder, node, plus, [](float sum, float) noexcept { return sum; });
}

void build_reduce_mean(Builder& builder, const Node& node) {
  build_reduction(builder, node, plus, [](float sum, float count) noexcept { return sum / count; });
}

void build_reduce_l2(Builder& builder, const Node& node) {
  build_reduction(
      builder, node, [](float sum, float x) noexcept { return sum + x * x; },
      [](float sum, float) noexcept { return std::sqrt(sum); });
}

}  // namespace takt::onnx_engine
