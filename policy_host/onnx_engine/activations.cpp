// SPDX-License-Identifier: Apache-2.0
// Functions of one element: arithmetic (Abs, Neg, Reciprocal, Sqrt, Exp, Log, Sin, Cos, Erf), activations (Relu,
// LeakyRelu, ThresholdedRelu, Elu, Selu, Celu, Tanh, Sigmoid, HardSigmoid, HardSwish, Mish, Softplus, Softsign, Shrink,
// Gelu) and Clip.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/unary.hpp"

namespace takt::onnx_engine {

namespace {

Lane lane_erf(const Lane& x) noexcept {
  return x.unaryExpr([](float v) { return std::erf(v); });
}

Lane lane_gelu(const Lane& x) noexcept {
  constexpr float inverse_root = std::numbers::sqrt2_v<float> / 2.0F;
  return 0.5F * x * (1.0F + lane_erf(x * inverse_root));
}

Lane lane_gelu_tanh(const Lane& x) noexcept {
  const float inner = std::sqrt(2.0F * std::numbers::inv_pi_v<float>);
  return 0.5F * x * (1.0F + lane_tanh(inner * (x + 0.044715F * x * x * x)));
}

}  // namespace

void build_abs(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return x.abs(); });
}

void build_neg(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return -x; });
}

void build_reciprocal(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return 1.0F / x; });
}

void build_exp(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept { return lane_exp(x); });
}

void build_log(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return x.log(); });
}

void build_sin(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return x.sin(); });
}

void build_cos(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return x.cos(); });
}

void build_softplus(Builder& builder, const Node& node) {
  // log(1 + e^x) without overflow for large x.
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return lane_relu(x) + lane_exp(-x.abs()).log1p(); });
}

void build_gelu(Builder& builder, const Node& node) {
  const std::string approximate = node.text("approximate", "none");
  if (approximate == "tanh") return build_unary(builder, node, lane_gelu_tanh);
  if (approximate != "none") node.beyond(fmt::format("approximate '{}' is not supported", approximate));
  build_unary(builder, node, lane_gelu);
}

void build_sqrt(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return x.sqrt(); });
}

void build_relu(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept { return lane_relu(x); });
}

void build_elu(Builder& builder, const Node& node) {
  build_unary(builder, node,
              [alpha = node.number("alpha", 1.0F)](const Lane& x) noexcept { return lane_elu(x, alpha); });
}

void build_selu(Builder& builder, const Node& node) {
  constexpr float usual_alpha = 1.67326319217681884765625F, usual_gamma = 1.05070102214813232421875F;
  build_unary(builder, node,
              [alpha = node.number("alpha", usual_alpha), gamma = node.number("gamma", usual_gamma)](
                  const Lane& x) noexcept -> Lane { return gamma * lane_elu(x, alpha); });
}

void build_celu(Builder& builder, const Node& node) {
  const float alpha = node.number("alpha", 1.0F);
  if (alpha == 0.0F) node.refuse("its alpha is 0");
  build_unary(builder, node, [alpha](const Lane& x) noexcept -> Lane {
    return lane_relu(x) + alpha * (lane_min(x / alpha, Lane::Zero()).exp() - 1.0F);
  });
}

namespace {

Lane lane_hard_sigmoid(const Lane& x, float alpha, float beta) noexcept {
  return lane_min(lane_relu(alpha * x + beta), Lane::Ones());
}

}  // namespace

void build_hard_sigmoid(Builder& builder, const Node& node) {
  build_unary(builder, node,
              [alpha = node.number("alpha", 0.2F), beta = node.number("beta", 0.5F)](const Lane& x) noexcept {
                return lane_hard_sigmoid(x, alpha, beta);
              });
}

void build_hard_swish(Builder& builder, const Node& node) {
  build_unary(builder, node,
              [](const Lane& x) noexcept -> Lane { return x * lane_hard_sigmoid(x, 1.0F / 6.0F, 0.5F); });
}

void build_thresholded_relu(Builder& builder, const Node& node) {
  build_unary(builder, node, [alpha = node.number("alpha", 1.0F)](const Lane& x) noexcept -> Lane {
    return x.unaryExpr([alpha](float one) { return one <= alpha ? 0.0F : one; });
  });
}

void build_shrink(Builder& builder, const Node& node) {
  build_unary(builder, node,
              [edge = node.number("lambd", 0.5F), bias = node.number("bias", 0.0F)](const Lane& x) noexcept -> Lane {
                return x.unaryExpr([edge, bias](float one) {
                  if (one < -edge) return one + bias;
                  if (one > edge) return one - bias;
                  return std::isnan(one) ? one : 0.0F;
                });
              });
}

void build_softsign(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept -> Lane { return x / (1.0F + x.abs()); });
}

void build_mish(Builder& builder, const Node& node) {
  build_unary(builder, node,
              [](const Lane& x) noexcept -> Lane { return x * lane_tanh(lane_relu(x) + lane_exp(-x.abs()).log1p()); });
}

void build_tanh(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept { return lane_tanh(x); });
}

void build_sigmoid(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept { return lane_sigmoid(x); });
}

void build_erf(Builder& builder, const Node& node) {
  build_unary(builder, node, lane_erf);
}

void build_leaky_relu(Builder& builder, const Node& node) {
  build_unary(builder, node, [slope = node.number("alpha", 0.01F)](const Lane& x) noexcept -> Lane {
    return lane_relu(x) + slope * lane_min(x, Lane::Zero());
  });
}

namespace {

// A bound is an input since opset 11, an attribute before; each may be missing.
template <class Number>
Number bound(const Node& node, std::size_t input, std::string_view attribute, Number otherwise) {
  if (!node.has_input(input)) {
    return node.has_attribute(attribute) ? static_cast<Number>(node.number(attribute, 0.0F)) : otherwise;
  }
  const Value& value = node.input(input);
  if (!value.constant || elements(value.shape) != 1) node.beyond("its bounds must be single constants");
  return value.type == ElementType::int64 ? static_cast<Number>(value.integers[0])
                                          : static_cast<Number>(value.floats[0]);
}

void clip_known_integers(Builder& builder, const Node& node, const Value& in) {
  using Limits = std::numeric_limits<std::int64_t>;
  const std::int64_t low = bound<std::int64_t>(node, 1, "min", Limits::lowest());
  const std::int64_t high = bound<std::int64_t>(node, 2, "max", Limits::max());
  std::vector<std::int64_t> clipped = in.integers;
  for (std::int64_t& i : clipped) i = std::min(std::max(i, low), high);
  builder.define_integers(node.output(), in.shape, std::move(clipped));
}

}  // namespace

void build_clip(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  if (in.type == ElementType::boolean) node.refuse("input 0 must be a number");
  if (in.type == ElementType::int64) return clip_known_integers(builder, node, in);
  const float low = bound(node, 1, "min", std::numeric_limits<float>::lowest());
  const float high = bound(node, 2, "max", std::numeric_limits<float>::max());
  Value& out = builder.define_floats(node.output(), in.shape, in.type);
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, count = elements(in.shape), low, high]() noexcept {
    map_lanes(from, to, count, [low, high](const Lane& x) noexcept {
      return lane_min(lane_max(x, Lane::Constant(low)), Lane::Constant(high));
    });
  });
}

}  // namespace takt::onnx_engine
