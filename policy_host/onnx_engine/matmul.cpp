// SPDX-License-Identifier: Apache-2.0
// Gemm and MatMul, both on the panel product.
#include <fmt/format.h>

#include <Eigen/Core>
#include <utility>

#include "policy_host/onnx_engine/broadcast.hpp"
#include "policy_host/onnx_engine/elementwise.hpp"
#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/panels.hpp"

namespace takt::onnx_engine {

namespace {

// One right-hand matrix inside a value, as pack_panels wants it.
struct RightMatrix {
  std::size_t inner;
  std::size_t columns;
  std::size_t row_step;
  std::size_t column_step;
};

void scale(float* values, std::size_t count, float factor) noexcept {
  Eigen::Map<Eigen::ArrayXf>(values, static_cast<Eigen::Index>(count)) *= factor;
}

// Left operand of Gemm as rows x inner, row-major: `a` itself or its transpose, made anew on every run.
const float* left_operand(Builder& builder, const Value& a, bool transposed) {
  if (!transposed) return a.floats;
  const auto rows = static_cast<Eigen::Index>(a.shape[0]);
  const auto columns = static_cast<Eigen::Index>(a.shape[1]);
  float* flipped = builder.allocate(elements(a.shape));
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  builder.each_run([from = a.floats, flipped, rows, columns]() noexcept {
    Eigen::Map<RowMajor>(flipped, columns, rows) = Eigen::Map<const RowMajor>(from, rows, columns).transpose();
  });
  return flipped;
}

// Packed form of `b`: once if it is constant, else on every run before the product.
const float* packed_operand(Builder& builder, const Value& b, const RightMatrix& m) {
  const std::size_t size = packed_size(m.inner, m.columns);
  const auto pack = [from = b.floats, m](float* packed) noexcept {
    pack_panels(from, m.inner, m.columns, m.row_step, m.column_step, packed);
  };
  if (b.constant) return builder.constant(size, pack);
  float* packed = builder.allocate(size);
  builder.each_run([pack, packed]() noexcept { pack(packed); });
  return packed;
}

// Stacks of matrices: pack one right-hand matrix, multiply, go on to the next.
void multiply_stacks(Builder& builder, const Value& a, const Value& b, Broadcast plan, std::size_t rows,
                     const RightMatrix& m, float* result) {
  builder.charge(plan.left_offsets.size() * 2 * sizeof(std::uint32_t));
  float* packed = builder.allocate(packed_size(m.inner, m.columns));
  builder.each_run([plan = std::move(plan), from_a = a.floats, from_b = b.floats, packed, rows, m, result]() noexcept {
    float* out = result;
    for (std::size_t r = 0; r < plan.left_offsets.size(); ++r) {
      for (std::size_t i = 0; i < plan.length; ++i, out += rows * m.columns) {
        const float* one_a = from_a + (plan.left_offsets[r] + (plan.left_advances ? i : 0)) * rows * m.inner;
        const float* one_b = from_b + (plan.right_offsets[r] + (plan.right_advances ? i : 0)) * m.inner * m.columns;
        pack_panels(one_b, m.inner, m.columns, m.row_step, m.column_step, packed);
        multiply_panels(one_a, packed, rows, m.inner, m.columns, out);
      }
    }
  });
}

}  // namespace

void build_gemm(Builder& builder, const Node& node) {
  const Value& a = node.float_input(0);
  const Value& b = node.float_input(1);
  if (a.shape.size() != 2 || b.shape.size() != 2) node.refuse("both factors must be matrices");
  const bool flip_a = node.integer("transA", 0) != 0;
  const bool flip_b = node.integer("transB", 0) != 0;
  const std::int64_t rows = a.shape[flip_a ? 1 : 0];
  const std::int64_t inner = a.shape[flip_a ? 0 : 1];
  const std::int64_t columns = b.shape[flip_b ? 0 : 1];
  if (inner != b.shape[flip_b ? 1 : 0]) {
    node.refuse(fmt::format("shapes {} and {} do not multiply", to_text(a.shape), to_text(b.shape)));
  }
  RightMatrix m{static_cast<std::size_t>(inner), static_cast<std::size_t>(columns), 1, 1};
  (flip_b ? m.column_step : m.row_step) = flip_b ? m.inner : m.columns;

  builder.count_matrix_work(static_cast<std::size_t>(rows), m.inner, m.columns);
  const Value& out = builder.define_floats(node.output(), {rows, columns});
  const float* left = left_operand(builder, a, flip_a);
  const float* packed = packed_operand(builder, b, m);
  const float alpha = node.number("alpha", 1.0F);
  builder.each_run([left, packed, m, height = static_cast<std::size_t>(rows), alpha, result = out.floats]() noexcept {
    multiply_panels(left, packed, height, m.inner, m.columns, result);
    if (alpha != 1.0F) scale(result, height * m.columns, alpha);
  });

  if (!node.has_input(2)) return;
  const Value& c = node.float_input(2);
  const float beta = node.number("beta", 1.0F);
  if (beta == 1.0F) return add_in_place(builder, node, out, c);
  Value& scaled = builder.define_floats("", c.shape);
  builder.compute(scaled, {&c}, [from = c.floats, to = scaled.floats, count = elements(c.shape), beta]() noexcept {
    for (std::size_t i = 0; i < count; ++i) to[i] = beta * from[i];
  });
  add_in_place(builder, node, out, scaled);
}

void build_matmul(Builder& builder, const Node& node) {
  const Value& a = node.float_input(0);
  const Value& b = node.float_input(1);
  if (a.shape.empty() || b.shape.empty()) node.refuse("a scalar is no factor");
  // A vector on the left is a row, one on the right a column; that dimension then vanishes from the result.
  Shape left = a.shape;
  Shape right = b.shape;
  if (left.size() == 1) left.insert(left.begin(), 1);
  if (right.size() == 1) right.push_back(1);
  const std::int64_t rows = left[left.size() - 2];
  const std::int64_t inner = left.back();
  const std::int64_t columns = right.back();
  if (inner != right[right.size() - 2]) {
    node.refuse(fmt::format("shapes {} and {} do not multiply", to_text(a.shape), to_text(b.shape)));
  }
  const RightMatrix m{static_cast<std::size_t>(inner), static_cast<std::size_t>(columns),
                      static_cast<std::size_t>(columns), 1};
  left.resize(left.size() - 2);
  right.resize(right.size() - 2);

  std::optional<Shape> stacked = broadcast_shape(left, right);
  if (!stacked) node.refuse(fmt::format("stacks {} and {} do not broadcast", to_text(left), to_text(right)));
  Shape shape = *stacked;
  if (a.shape.size() > 1) shape.push_back(rows);
  if (b.shape.size() > 1) shape.push_back(columns);
  const Value& out = builder.define_floats(node.output(), shape);
  builder.count_matrix_work(elements(*stacked) * static_cast<std::size_t>(rows), m.inner, m.columns);

  if (elements(right) != 1) {
    std::optional<Broadcast> plan = plan_broadcast(left, right);
    if (!plan) node.beyond("its stack of products is too large");
    multiply_stacks(builder, a, b, *std::move(plan), static_cast<std::size_t>(rows), m, out.floats);
    return;
  }
  // One right-hand matrix for the whole stack on the left: a single product of more rows.
  const float* packed = packed_operand(builder, b, m);
  builder.each_run(
      [from = a.floats, packed, m, height = elements(left) * static_cast<std::size_t>(rows),
       result = out.floats]() noexcept { multiply_panels(from, packed, height, m.inner, m.columns, result); });
}

}  // namespace takt::onnx_engine
