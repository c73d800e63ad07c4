// SPDX-License-Identifier: Apache-2.0
// Equal, Greater, GreaterOrEqual, Less, LessOrEqual; And, Or, Xor of truths; and Where, which chooses by one.
//
// Not a number has no truth: a comparison with it is not a number, and what Where chooses by it too. (The specification
// says false; a policy must not act on that.)
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "policy_host/onnx_engine/broadcast.hpp"
#include "policy_host/onnx_engine/elementwise.hpp"
#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

namespace {

// Where each element of a result of `shape` finds its own in an operand that broadcasts to it.
std::vector<std::uint32_t> broadcast_table(Builder& builder, const Shape& operand, const Shape& shape) {
  std::vector<std::int64_t> steps = row_major_steps(operand);
  for (std::size_t d = 0; d < steps.size(); ++d) {
    if (operand[d] == 1) steps[d] = 0;
  }
  steps.insert(steps.begin(), shape.size() - steps.size(), 0);
  builder.charge(elements(shape) * sizeof(std::uint32_t));
  return strided_offsets(shape, steps, 0);
}

Shape common_shape(const Node& node, const Shape& left, const Shape& right) {
  const std::optional<Shape> shape = broadcast_shape(left, right);
  if (!shape) node.refuse(fmt::format("shapes {} and {} do not broadcast", to_text(left), to_text(right)));
  return *shape;
}

template <class Compare>
void build_comparison(Builder& builder, const Node& node, Compare compare) {
  Value a = node.input(0);
  Value b = node.input(1);
  if (a.type == ElementType::live_int64 || b.type == ElementType::live_int64) {
    a = as_live(builder, node, a);
    b = as_live(builder, node, b);
  }
  if (a.type != b.type) node.beyond("its two inputs differ in data type");
  const Shape shape = common_shape(node, a.shape, b.shape);
  std::vector<std::uint32_t> in_a = broadcast_table(builder, a.shape, shape);
  std::vector<std::uint32_t> in_b = broadcast_table(builder, b.shape, shape);
  Value& out = builder.define_floats(node.output(), shape, ElementType::boolean);
  if (a.type == ElementType::int64) {
    for (std::size_t i = 0; i < in_a.size(); ++i) {
      out.floats[i] = compare(a.integers[in_a[i]], b.integers[in_b[i]]) ? 1.0F : 0.0F;
    }
    out.constant = true;
    return;
  }
  builder.compute(out, {&a, &b},
                  [in_a = std::move(in_a), in_b = std::move(in_b), left = a.floats, right = b.floats, to = out.floats,
                   compare]() noexcept {
                    for (std::size_t i = 0; i < in_a.size(); ++i) {
                      const float x = left[in_a[i]];
                      const float y = right[in_b[i]];
                      const bool judged = !std::isnan(x) && !std::isnan(y);
                      const float truth = compare(x, y) ? 1.0F : 0.0F;
                      to[i] = judged ? truth : std::numeric_limits<float>::quiet_NaN();
                    }
                  });
}

}  // namespace

void build_equal(Builder& builder, const Node& node) {
  build_comparison(builder, node, [](auto x, auto y) noexcept { return x == y; });
}
void build_greater(Builder& builder, const Node& node) {
  build_comparison(builder, node, [](auto x, auto y) noexcept { return x > y; });
}
void build_greater_or_equal(Builder& builder, const Node& node) {
  build_comparison(builder, node, [](auto x, auto y) noexcept { return x >= y; });
}
void build_less(Builder& builder, const Node& node) {
  build_comparison(builder, node, [](auto x, auto y) noexcept { return x < y; });
}
void build_less_or_equal(Builder& builder, const Node& node) {
  build_comparison(builder, node, [](auto x, auto y) noexcept { return x <= y; });
}

namespace {

template <class Join>
void build_of_truths(Builder& builder, const Node& node, Join join) {
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}})
    if (node.input(i).type != ElementType::boolean) node.refuse(fmt::format("input {} must be bool", i));
  build_comparison(builder, node, join);
}

}  // namespace

void build_and(Builder& builder, const Node& node) {
  build_of_truths(builder, node, [](auto x, auto y) noexcept { return x != 0 && y != 0; });
}
void build_or(Builder& builder, const Node& node) {
  build_of_truths(builder, node, [](auto x, auto y) noexcept { return x != 0 || y != 0; });
}
void build_xor(Builder& builder, const Node& node) {
  build_of_truths(builder, node, [](auto x, auto y) noexcept { return (x != 0) != (y != 0); });
}

void build_where(Builder& builder, const Node& node) {
  const Value& truth = node.input(0);
  const Value& a = node.input(1);
  const Value& b = node.input(2);
  if (truth.type != ElementType::boolean) node.refuse("input 0 must be bool");
  if (a.type != b.type) node.beyond("its two choices differ in data type");
  const Shape shape = common_shape(node, common_shape(node, a.shape, b.shape), truth.shape);
  std::vector<std::uint32_t> in_truth = broadcast_table(builder, truth.shape, shape);
  std::vector<std::uint32_t> in_a = broadcast_table(builder, a.shape, shape);
  std::vector<std::uint32_t> in_b = broadcast_table(builder, b.shape, shape);
  if (a.type == ElementType::int64) {
    if (!truth.constant) node.beyond("int64 chosen by a truth that an input decides is not supported");
    std::vector<std::int64_t> chosen;
    for (std::size_t i = 0; i < in_truth.size(); ++i) {
      chosen.push_back(truth.floats[in_truth[i]] != 0.0F ? a.integers[in_a[i]] : b.integers[in_b[i]]);
    }
    builder.define_integers(node.output(), shape, std::move(chosen));
    return;
  }
  Value& out = builder.define_floats(node.output(), shape, a.type);
  builder.compute(out, {&truth, &a, &b},
                  [in_truth = std::move(in_truth), in_a = std::move(in_a), in_b = std::move(in_b), by = truth.floats,
                   left = a.floats, right = b.floats, to = out.floats]() noexcept {
                    for (std::size_t i = 0; i < in_truth.size(); ++i) {
                      const float choice = by[in_truth[i]];
                      const float chosen = choice != 0.0F ? left[in_a[i]] : right[in_b[i]];
                      to[i] = std::isnan(choice) ? choice : chosen;
                    }
                  });
}

}  // namespace takt::onnx_engine
