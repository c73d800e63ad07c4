// SPDX-License-Identifier: Apache-2.0
// Add, Sub, Mul, Div, Mod, Pow, PRelu, and Min, Max, Sum, Mean of any number, with NumPy broadcasting; those of whole
// numbers on int64 too, known ones (where exporters compute shapes) and those that an input decides.
#include "policy_host/onnx_engine/elementwise.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "policy_host/onnx_engine/broadcast.hpp"
#include "policy_host/onnx_engine/operators.hpp"

namespace takt::onnx_engine {

Value as_live(Builder& builder, const Node& node, const Value& value) {
  Value live = value;
  if (value.type == ElementType::int64) {
    live = builder.define_floats("", value.shape);
    std::ranges::transform(value.integers, live.floats, [](std::int64_t i) { return static_cast<float>(i); });
    live.constant = true;
  } else if (value.type != ElementType::live_int64) {
    node.beyond("its inputs differ in data type");
  }
  live.type = ElementType::float32;
  return live;
}

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

// Not a number on either side comes out of both.
float smaller(float a, float b) noexcept {
  return a < b || std::isnan(a) ? a : b;
}
float larger(float a, float b) noexcept {
  return a > b || std::isnan(a) ? a : b;
}

template <auto function>
void run_each(const Broadcast& plan, const float* left, const float* right, float* out) noexcept {
  for (std::size_t r = 0; r < plan.left_offsets.size(); ++r) {
    const float* a = left + plan.left_offsets[r];
    const float* b = right + plan.right_offsets[r];
    for (std::size_t i = 0; i < plan.length; ++i) {
      *out++ = function(plan.left_advances ? a[i] : *a, plan.right_advances ? b[i] : *b);
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

void build_integers(Builder& builder, const Node& node, const std::string& name, const Value& a, const Value& b,
                    OnIntegers operation) {
  if (operation == nullptr) node.beyond("int64 operands are not supported");
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
  builder.define_integers(name, plan.shape, std::move(result));
}

// The result of `a` and `b`, called `name`.
void build_pair(Builder& builder, const Node& node, const std::string& name, const Value& a, const Value& b,
                RunFloats run, OnIntegers on_integers) {
  if (a.type != b.type) node.beyond("its inputs differ in data type");
  if (a.type == ElementType::int64) return build_integers(builder, node, name, a, b, on_integers);
  if (a.type != ElementType::float32) node.beyond(fmt::format("operands of {} are not supported", to_text(a.type)));
  Broadcast plan = plan_for(builder, node, a.shape, b.shape);
  Value& out = builder.define_floats(name, plan.shape);
  builder.compute(out, {&a, &b},
                  [plan = std::move(plan), left = a.floats, right = b.floats, result = out.floats, run]() noexcept {
                    run(plan, left, right, result);
                  });
}

// Integers that an input decides meet known ones as floats.
void build_binary(Builder& builder, const Node& node, RunFloats run, OnIntegers on_integers) {
  const Value &a = node.input(0), &b = node.input(1);
  const bool live = a.type == ElementType::live_int64 || b.type == ElementType::live_int64;
  if (!live || on_integers == nullptr) return build_pair(builder, node, node.output(), a, b, run, on_integers);
  const std::string name = fmt::format("{} as floats", node.output());
  build_pair(builder, node, name, as_live(builder, node, a), as_live(builder, node, b), run, on_integers);
  Value result = *builder.find(name);
  result.type = ElementType::live_int64;
  builder.define_view(node.output(), result.shape, result);
}

// Any number of inputs, pair by pair; one alone is itself. Integers that an input decides meet known ones as floats.
void build_chain(Builder& builder, const Node& node, RunFloats run, OnIntegers on_integers) {
  std::vector<Value> terms;
  bool live = false;
  for (std::size_t i = 0; i < node.input_count(); ++i) {
    terms.push_back(node.input(i));
    live = live || terms.back().type == ElementType::live_int64;
  }
  for (Value& term : terms) {
    if (live) term = as_live(builder, node, term);
  }
  if (terms.empty()) node.refuse("input 0 is missing");
  Value so_far = terms.front();
  for (std::size_t i = 1; i < terms.size(); ++i) {
    const std::string name = fmt::format("{} of {} inputs of {}", i, terms.size(), node.output());
    build_pair(builder, node, name, so_far, terms[i], run, on_integers);
    so_far = *builder.find(name);
  }
  if (live) so_far.type = ElementType::live_int64;
  builder.define_view(node.output(), so_far.shape, so_far);
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

// The remainder has the divisor's sign.
std::optional<std::int64_t> modulo_integers(std::int64_t a, std::int64_t b) {
  if (b == 0) return std::nullopt;
  if (b == -1) return 0;
  const std::int64_t rest = a % b;
  return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
}
float modulo(float a, float b) noexcept {
  const float rest = std::fmod(a, b);
  return rest != 0.0F && (rest < 0.0F) != (b < 0.0F) ? rest + b : rest;
}
// The dividend's, as C has it.
float remainder_of(float a, float b) noexcept {
  return std::fmod(a, b);
}

// Of whole numbers: cut towards zero, as divide_integers() does.
template <bool whole>
void divide(const Broadcast& plan, const float* left, const float* right, float* out) noexcept {
  run_rows<Over>(plan, left, right, out);
  if constexpr (whole)
    for (float* one = out; one != out + plan.left_offsets.size() * plan.length; ++one) *one = std::trunc(*one);
}

float leaky(float x, float slope) noexcept {
  return x < 0.0F ? slope * x : x;
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
  const auto is_live = [&](std::size_t i) { return node.input(i).type == ElementType::live_int64; };
  build_binary(builder, node, is_live(0) || is_live(1) ? divide<true> : divide<false>, divide_integers);
}
void build_pow(Builder& builder, const Node& node) {
  build_binary(builder, node, run_each<power>, nullptr);
}
void build_min(Builder& builder, const Node& node) {
  build_chain(builder, node, run_each<smaller>,
              [](std::int64_t a, std::int64_t b) { return std::optional(std::min(a, b)); });
}
void build_max(Builder& builder, const Node& node) {
  build_chain(builder, node, run_each<larger>,
              [](std::int64_t a, std::int64_t b) { return std::optional(std::max(a, b)); });
}

void build_sum(Builder& builder, const Node& node) {
  build_chain(builder, node, run_rows<Plus>, add_integers);
}

void build_mean(Builder& builder, const Node& node) {
  Value sum = node.float_input(0);
  for (std::size_t i = 1; i < node.input_count(); ++i) {
    const std::string name = fmt::format("{} of {} inputs of {}", i, node.input_count(), node.output());
    build_pair(builder, node, name, sum, node.float_input(i), run_rows<Plus>, nullptr);
    sum = *builder.find(name);
  }
  Value& out = builder.define_floats(node.output(), sum.shape);
  builder.compute(out, {&sum},
                  [from = sum.floats, to = out.floats, size = elements(sum.shape),
                   count = static_cast<float>(node.input_count())]() noexcept {
                    for (std::size_t i = 0; i < size; ++i) to[i] = from[i] / count;
                  });
}

// A slope is broadcast to the input, and never the other way round.
void build_prelu(Builder& builder, const Node& node) {
  const Value &in = node.float_input(0), &slope = node.float_input(1);
  const auto shape = broadcast_shape(in.shape, slope.shape);
  if (!shape || *shape != in.shape)
    node.refuse(fmt::format("a slope of shape {} does not broadcast to {}", to_text(slope.shape), to_text(in.shape)));
  build_binary(builder, node, run_each<leaky>, nullptr);
}

void build_mod(Builder& builder, const Node& node) {
  const bool whole = node.input(0).type != ElementType::float32;
  if (whole == (node.integer("fmod", 0) != 0))
    node.beyond("fmod is supported of float32 alone, and no other way there");
  if (whole) {
    build_chain(builder, node, run_each<modulo>, modulo_integers);
  } else {
    build_binary(builder, node, run_each<remainder_of>, nullptr);
  }
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
