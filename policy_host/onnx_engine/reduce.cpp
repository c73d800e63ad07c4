// SPDX-License-Identifier: Apache-2.0
// Reductions over some axes: ReduceMean, ReduceSum, ReduceMax, ReduceMin, ReduceProd, ReduceL1, ReduceL2,
// ReduceSumSquare, ReduceLogSum, ReduceLogSumExp; ArgMax, ArgMin and CumSum over one. They run in ascending order; not
// a number among the elements is the result.
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

namespace {

using Terms = std::span<const std::uint32_t>;  // of one result, counted from its first

// `make(first, terms)` is a result.
template <class Make>
void build_over(Builder& builder, const Node& node, const std::vector<bool>& reduced, ElementType type, Make make) {
  const Value& in = node.float_input(0);
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
  Value& out = builder.define_floats(node.output(), shape, type);
  builder.compute(out, {&in},
                  [from = in.floats, to = out.floats, starts = strided_offsets(kept, kept_steps, 0),
                   terms = strided_offsets(summed, summed_steps, 0), make]() noexcept {
                    for (std::size_t i = 0; i < starts.size(); ++i) to[i] = make(from + starts[i], Terms(terms));
                  });
}

template <class Make>
void build_made(Builder& builder, const Node& node, Make make) {
  const Value& in = node.float_input(0);
  const std::vector<std::int64_t> axes = node.axes(1).value_or(std::vector<std::int64_t>{});
  const bool none = axes.empty() && node.integer("noop_with_empty_axes", 0) != 0;
  std::vector<bool> reduced(in.shape.size(), axes.empty() && !none);
  for (const std::int64_t axis : axes) reduced[node.axis(axis, in.shape.size())] = true;
  build_over(builder, node, reduced, ElementType::float32, make);
}

// `add(sum, x)` for every element in turn, then `finish(sum, count)`.
template <class Add, class Finish>
void build_reduction(Builder& builder, const Node& node, float start, Add add, Finish finish) {
  build_made(builder, node, [start, add, finish](const float* first, Terms terms) noexcept {
    float sum = start;
    for (const std::uint32_t term : terms) sum = add(sum, first[term]);
    return finish(sum, static_cast<float>(terms.size()));
  });
}

float as_it_is(float sum, float) noexcept {
  return sum;
}

float larger_of(float a, float b) noexcept {
  return a > b || std::isnan(a) ? a : b;
}
float smaller_of(float a, float b) noexcept {
  return a < b || std::isnan(a) ? a : b;
}

// The largest is subtracted first, so that exp cannot overflow.
float log_sum_exp(const float* first, Terms terms) noexcept {
  float largest = -std::numeric_limits<float>::infinity();
  for (const std::uint32_t term : terms) largest = larger_of(largest, first[term]);
  if (std::isinf(largest)) return largest;
  float sum = 0.0F;
  for (const std::uint32_t term : terms) sum += std::exp(first[term] - largest);
  return largest + std::log(sum);
}

// Where the element is that `leads` all others; of equal ones the first, or the last.
template <class Leads>
void build_place(Builder& builder, const Node& node, Leads leads) {
  const std::size_t rank = node.float_input(0).shape.size();
  std::vector<bool> reduced(rank, false);
  reduced[node.axis(node.integer("axis", 0), rank)] = true;
  const bool last = node.integer("select_last_index", 0) != 0;
  build_over(builder, node, reduced, ElementType::live_int64, [last, leads](const float* first, Terms terms) noexcept {
    std::size_t best = 0;
    for (std::size_t i = 0; i < terms.size(); ++i) {
      const float x = first[terms[i]], so_far = first[terms[best]];
      if (std::isnan(x)) return x;
      if (leads(x, so_far) || (last && x == so_far)) best = i;
    }
    return static_cast<float>(best);
  });
}

float plus(float sum, float x) noexcept {
  return sum + x;
}

}  // namespace

void build_reduce_sum(Builder& builder, const Node& node) {
  build_reduction(builder, node, 0.0F, plus, as_it_is);
}

void build_reduce_mean(Builder& builder, const Node& node) {
  build_reduction(builder, node, 0.0F, plus, [](float sum, float count) noexcept { return sum / count; });
}

void build_reduce_max(Builder& builder, const Node& node) {
  build_reduction(builder, node, -std::numeric_limits<float>::infinity(), larger_of, as_it_is);
}

void build_reduce_min(Builder& builder, const Node& node) {
  build_reduction(builder, node, std::numeric_limits<float>::infinity(), smaller_of, as_it_is);
}

void build_reduce_prod(Builder& builder, const Node& node) {
  build_reduction(
      builder, node, 1.0F, [](float product, float x) noexcept { return product * x; }, as_it_is);
}

void build_reduce_l1(Builder& builder, const Node& node) {
  build_reduction(
      builder, node, 0.0F, [](float sum, float x) noexcept { return sum + std::abs(x); }, as_it_is);
}

void build_reduce_l2(Builder& builder, const Node& node) {
  build_reduction(
      builder, node, 0.0F, [](float sum, float x) noexcept { return sum + x * x; },
      [](float sum, float) noexcept { return std::sqrt(sum); });
}

void build_reduce_sum_square(Builder& builder, const Node& node) {
  build_reduction(
      builder, node, 0.0F, [](float sum, float x) noexcept { return sum + x * x; }, as_it_is);
}

void build_reduce_log_sum(Builder& builder, const Node& node) {
  build_reduction(builder, node, 0.0F, plus, [](float sum, float) noexcept { return std::log(sum); });
}

void build_reduce_log_sum_exp(Builder& builder, const Node& node) {
  build_made(builder, node, log_sum_exp);
}

void build_arg_max(Builder& builder, const Node& node) {
  build_place(builder, node, [](float x, float so_far) noexcept { return x > so_far; });
}

void build_arg_min(Builder& builder, const Node& node) {
  build_place(builder, node, [](float x, float so_far) noexcept { return x < so_far; });
}

void build_cum_sum(Builder& builder, const Node& node) {
  const Value& in = node.float_input(0);
  const std::vector<std::int64_t>& given = node.integer_input(1);
  if (given.size() != 1) node.refuse("its axis must be one number");
  const std::size_t rank = in.shape.size(), axis = node.axis(given[0], rank);
  const bool exclusive = node.integer("exclusive", 0) != 0, reverse = node.integer("reverse", 0) != 0;
  Value& out = builder.define_floats(node.output(), in.shape);
  builder.compute(out, {&in},
                  [from = in.floats, to = out.floats, outer = elements_between(in.shape, 0, axis),
                   size = static_cast<std::size_t>(in.shape[axis]), inner = elements_between(in.shape, axis + 1, rank),
                   exclusive, reverse]() noexcept {
                    for (std::size_t o = 0; o < outer; ++o) {
                      for (std::size_t i = 0; i < inner; ++i) {
                        float sum = 0.0F;
                        for (std::size_t k = 0; k < size; ++k) {
                          const std::size_t at = (o * size + (reverse ? size - 1 - k : k)) * inner + i;
                          to[at] = exclusive ? sum : sum + from[at];
                          sum += from[at];
                        }
                      }
                    }
                  });
}

}  // namespace takt::onnx_engine
