// SPDX-License-Identifier: Apache-2.0
// Functions of one element that the C library has: Acos, Acosh, Asin, Asinh, Atan, Atanh, Cosh, Sinh, Tan, Ceil, Floor,
// Round, Sign; and Not, of a truth.
#include <cmath>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/unary.hpp"

namespace takt::onnx_engine {

namespace {

template <class Function>
void build_each(Builder& builder, const Node& node, Function function) {
  build_unary(builder, node, [function](const Lane& x) noexcept -> Lane { return x.unaryExpr(function); });
}

float sign(float x) noexcept {
  if (std::isnan(x)) return x;
  return x > 0.0F ? 1.0F : (x < 0.0F ? -1.0F : 0.0F);
}

}  // namespace

void build_acos(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::acos(x); });
}
void build_acosh(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::acosh(x); });
}
void build_asin(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::asin(x); });
}
void build_asinh(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::asinh(x); });
}
void build_atan(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::atan(x); });
}
void build_atanh(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::atanh(x); });
}
void build_cosh(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::cosh(x); });
}
void build_sinh(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::sinh(x); });
}
void build_tan(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::tan(x); });
}
void build_ceil(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::ceil(x); });
}
void build_floor(Builder& builder, const Node& node) {
  build_each(builder, node, [](float x) noexcept { return std::floor(x); });
}
void build_round(Builder& builder, const Node& node) {  // halves to the even neighbour
  build_each(builder, node, [](float x) noexcept { return std::nearbyint(x); });
}
void build_sign(Builder& builder, const Node& node) {
  build_each(builder, node, sign);
}

void build_not(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  if (in.type != ElementType::boolean) node.refuse("input 0 must be bool");
  Value& out = builder.define_floats(node.output(), in.shape, ElementType::boolean);
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, count = elements(in.shape)]() noexcept {
    for (std::size_t i = 0; i < count; ++i) to[i] = std::isnan(from[i]) ? from[i] : 1.0F - from[i];
  });
}

}  // namespace takt::onnx_engine
