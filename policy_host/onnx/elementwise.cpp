// Add, Sub, Mul, Div, Pow with NumPy broadcasting; the first four on int64 constants too, where exporters compute
// shapes.
#include "policy_host/onnx/elementwise.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <utility>

#include "policy_host/onnx/broadcast.hpp"
#include "policy_host/onnx/operators.hpp"

namespace takt::onnx_engine {

namespace {

using Row = Eigen::Map<Eigen::ArrayXf>;
using ConstRow = Eigen::Map<const Eigen::ArrayXf>;

// The four IEEE operations round the same in a register and alone, so Eigen may walk a row as it likes.
struct Plus {
  static auto apply(const auto& a, const auto& b) { return a + b; }
};
struct Minus {
  static auto apply(const auto& a, const auto& b) { return a - b; }
};
struct Times {
  static auto apply(const auto& a, const auto& b) { return a * b; }
};
struct Over {
  static auto apply(const auto& a, const auto& b) { return a / b; }
};

template <class Operation>
void run_rows(const Broadcast& plan, const float* left, const float* right, float* out) noexcept {
  const auto length = static_cast<Eigen::Index>(plan.length);
  for (std::size_t r = 0; r < plan.left_offsets.size(); ++r, out += plan.length) {
    const float* a = left + plan.left_offsets[r];
    const float* b = right + plan.right_offsets[r];
    Row result(out, length);
    if (plan.left_advances && plan.right_advances) {
      result = Operation::apply(ConstRow(a, length), ConstRow(b, length));
    } else if (plan.left_advances) {
      result = Operation::apply(ConstRow(a, length), *b);
    } else {
      result = Operation::apply(*a, ConstRow(b, length));
    }
  }
}

float power(float base, float exponent) noexcept {
  // The exponents that exporters write, without the C library.
  if (exponent == 2.0F) return base * base;
  if (exponent == 1.0F) return base;
  if (exponent == 0.5F) return std::sqrt(base);
  return std::pow(base, exponent);
}

void run_power(const Broadcast& plan, const float* left, const float* right, float* out) noexcept {
  for (std::size_t r = 0; r < plan.left_offsets.size(); ++r) {
    const float* a = left + plan.left_offsets[r];
    const float* b = right + plan.right_offsets[r];
    for (std::size_t i = 0; i < plan.length; ++i) {
      *out++ = power(plan.left_advances ? a[i] : *a, plan.right_advances ? b[i] : *b);
    }
  }
}

Broadcast plan_for(Builder& builder, const Node& node, const Shape& left, const Shape& right) {
  std::optional<Broadcast> plan = plan_broadcast(left, right);
  if (!plan) node.refuse(fmt::format("shapes {} and {} do not broadcast", to_text(left), to_text(right)));
  builder.charge(plan->left_offsets.size() * 2 * sizeof(std::uint32_t));
  return *std::move(plan);
}

using RunFloats = void (*)(const Broadcast&, const float*, const float*, float*) noexcept;
using OnIntegers = std::optional<std::int64_t> (*)(std::int64_t, std::int64_t);

void build_integers(Builder& builder, const Node& node, const Value& a, const Value& b, OnIntegers operation) {
  if (operation == nullptr) node.refuse("int64 operands are not supported");
  const Broadcast plan = plan_for(builder, node, a.shape, b.shape);
  std::vector<std::int64_t> result;
  for (std::size_t r = 0; plan.length > 0 && r < plan.left_offsets.size(); ++r) {
    for (std::size_t i = 0; i < plan.length; ++i) {
      const std::int64_t left = a.integers[plan.left_offsets[r] + (plan.left_advances ? i : 0)];
      const std::int64_t right = b.integers[plan.right_offsets[r] + (plan.right_advances ? i : 0)];
      const std::optional<std::int64_t> value = operation(left, right);
      if (!value) node.refuse(fmt::format("integers {} and {} have no result", left, right));
      result.push_back(*value);
    }
  }
  builder.define_integers(node.output(), plan.shape, std::move(result));
}

void build_binary(Builder& builder, const Node& node, RunFloats run, OnIntegers on_integers) {
  const Value& a = node.input(0);
  const Value& b = node.input(1);
  if (a.type != b.type) node.refuse("its two inputs differ in data type");
  if (a.type == ElementType::int64) return build_integers(builder, node, a, b, on_integers);
  Broadcast plan = plan_for(builder, node, a.shape, b.shape);
  Value& out = builder.define_floats(node.output(), plan.shape);
  builder.compute(out, {&a, &b},
                  [plan = std::move(plan), left = a.floats, right = b.floats, result = out.floats, run]() noexcept {
                    run(plan, left, right, result);
                  });
}

std::optional<std::int64_t> add_integers(std::int64_t a, std::int64_t b) {
  std::int64_t result = 0;
  return __builtin_add_overflow(a, b, &result) ? std::nullopt : std::optional(result);
}

std::optional<std::int64_t> subtract_integers(std::int64_t a, std::int64_t b) {
  std::int64_t result = 0;
  return __builtin_sub_overflow(a, b, &result) ? std::nullopt : std::optional(result);
}

std::optional<std::int64_t> multiply_integers(std::int64_t a, std::int64_t b) {
  std::int64_t result = 0;
  return __builtin_mul_overflow(a, b, &result) ? std::nullopt : std::optional(result);
}

std::optional<std::int64_t> divide_integers(std::int64_t a, std::int64_t b) {
  if (b == 0 || (b == -1 && a == std::numeric_limits<std::int64_t>::min())) return std::nullopt;
  return a / b;
}

}  // namespace

void build_add(Builder& builder, const Node& node) {
  build_binary(builder, node, run_rows<Plus>, add_integers);
}
void build_sub(Builder& builder, const Node& node) {
  build_binary(builder, node, run_rows<Minus>, subtract_integers);
}
void build_mul(Builder& builder, const Node& node) {
  build_binary(builder, node, run_rows<Times>, multiply_integers);
}
void build_div(Builder& builder, const Node& node) {
  build_binary(builder, node, run_rows<Over>, divide_integers);
}
void build_pow(Builder& builder, const Node& node) {
  build_binary(builder, node, run_power, nullptr);
}

void add_in_place(Builder& builder, const Node& node, const Value& target, const Value& source) {
  Broadcast plan = plan_for(builder, node, target.shape, source.shape);
  if (plan.shape != target.shape) {
    node.refuse(fmt::format("{} does not broadcast to {}", to_text(source.shape), to_text(target.shape)));
  }
  builder.each_run([plan = std::move(plan), sum = target.floats, addend = source.floats]() noexcept {
    run_rows<Plus>(plan, sum, addend, sum);
  });
}

}  // namespace takt::onnx_engine
