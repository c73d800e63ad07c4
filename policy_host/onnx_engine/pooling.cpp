// SPDX-License-Identifier: Apache-2.0
// MaxPool, AveragePool, GlobalMaxPool, GlobalAveragePool: every channel's plane by itself. Sums run in ascending order.
#include <cmath>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/window.hpp"

namespace takt::onnx_engine {

namespace {

// Of each position of the output: its elements of a plane, and what an average divides by.
struct PoolPlan {
  std::vector<std::uint32_t> sources;
  std::vector<std::uint32_t> ends;  // of each position's sources
  std::vector<float> divisors;
};

PoolPlan plan_pool(Builder& builder, const Node& node, const Window& window, bool padding_counts) {
  const std::size_t positions = window.output_size();
  if (checked_elements({static_cast<std::int64_t>(positions), static_cast<std::int64_t>(window.kernel_size())}) < 0) {
    node.beyond("its windows are larger than this engine holds");
  }
  builder.charge(positions * (window.kernel_size() + 2) * sizeof(std::uint32_t));
  PoolPlan plan;
  for (std::size_t position = 0; position < positions; ++position) {
    std::size_t counted = 0;
    const std::size_t begin = plan.sources.size();
    for (std::size_t k = 0; k < window.kernel_size(); ++k) {
      const std::int64_t source = window.source(position, k);
      if (source >= 0) plan.sources.push_back(static_cast<std::uint32_t>(source));
      if (source >= 0 || (padding_counts && window.inside_padding(position, k))) ++counted;
    }
    // What ceil_mode makes of a window behind the input differs from opset to opset and from engine to engine.
    if (plan.sources.size() == begin) node.refuse("a window lies in the padding altogether");
    plan.ends.push_back(static_cast<std::uint32_t>(plan.sources.size()));
    plan.divisors.push_back(static_cast<float>(counted));
  }
  return plan;
}

// `take(plane, first, last, divisor)` makes one element of the output.
template <class Take>
void build_pool(Builder& builder, const Node& node, bool padding_counts, Take take) {
  const Value& in = node.float_input(0);
  const Window window = read_window(node, in.shape, {});
  PoolPlan plan = plan_pool(builder, node, window, padding_counts);
  Value& out = builder.define_floats(node.output(), window.output_shape(in.shape[0], in.shape[1]));
  builder.compute(out, {&in},
                  [plan = std::move(plan), from = in.floats, to = out.floats, take,
                   planes = elements_between(in.shape, 0, 2), plane = window.input_size()]() noexcept {
                    float* next = to;
                    for (std::size_t p = 0; p < planes; ++p) {
                      const std::uint32_t* source = plan.sources.data();
                      for (std::size_t i = 0; i < plan.ends.size(); ++i) {
                        const std::uint32_t* end = plan.sources.data() + plan.ends[i];
                        *next++ = take(from + p * plane, source, end, plan.divisors[i]);
                        source = end;
                      }
                    }
                  });
}

float average(const float* plane, const std::uint32_t* first, const std::uint32_t* last, float divisor) noexcept {
  float sum = 0.0F;
  for (; first != last; ++first) sum += plane[*first];
  return sum / divisor;
}

// Not a number wins: it must not vanish.
float largest(const float* plane, const std::uint32_t* first, const std::uint32_t* last, float) noexcept {
  float most = plane[*first];
  for (; first != last; ++first) most = plane[*first] <= most || std::isnan(most) ? most : plane[*first];
  return most;
}

}  // namespace

void build_average_pool(Builder& builder, const Node& node) {
  build_pool(builder, node, node.integer("count_include_pad", 0) != 0, average);
}

void build_max_pool(Builder& builder, const Node& node) {
  if (node.has_output(1)) node.beyond("its indices as an output are not supported");
  build_pool(builder, node, false, largest);
}

namespace {

// `take(plane, size)` makes one element of each plane.
template <class Take>
void build_global_pool(Builder& builder, const Node& node, Take take) {
  const Value& in = node.float_input(0);
  if (in.shape.size() < 3) node.refuse("its input has no spatial dimensions");
  Shape shape(in.shape.size(), 1);
  shape[0] = in.shape[0];
  shape[1] = in.shape[1];
  Value& out = builder.define_floats(node.output(), shape);
  builder.compute(out, {&in},
                  [from = in.floats, to = out.floats, planes = elements_between(in.shape, 0, 2),
                   plane = elements_between(in.shape, 2, in.shape.size()), take]() noexcept {
                    for (std::size_t p = 0; p < planes; ++p) to[p] = take(from + p * plane, plane);
                  });
}

}  // namespace

void build_global_average_pool(Builder& builder, const Node& node) {
  build_global_pool(builder, node, [](const float* plane, std::size_t size) noexcept {
    float sum = 0.0F;
    for (std::size_t i = 0; i < size; ++i) sum += plane[i];
    return sum / static_cast<float>(size);
  });
}

void build_global_max_pool(Builder& builder, const Node& node) {
  build_global_pool(builder, node, [](const float* plane, std::size_t size) noexcept {
    float most = plane[0];
    for (std::size_t i = 1; i < size; ++i) most = plane[i] <= most || std::isnan(most) ? most : plane[i];
    return most;
  });
}

}  // namespace takt::onnx_engine
