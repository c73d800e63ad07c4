// Functions of one element: Sqrt, Relu, LeakyRelu, Elu, Tanh, Sigmoid, Erf, Clip.
#include <cmath>
#include <limits>

#include "policy_host/onnx/lanes.hpp"
#include "policy_host/onnx/operators.hpp"

namespace takt::onnx_engine {

namespace {

template <class Function>
void build_unary(Builder& builder, const Node& node, Function function) {
  const Value& in = node.float_input(0);
  Value& out = builder.define_floats(node.output(), in.shape);
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, count = elements(in.shape), function]() noexcept {
    map_lanes(from, to, count, function);
  });
}

}  // namespace

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

void build_tanh(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept { return lane_tanh(x); });
}

void build_sigmoid(Builder& builder, const Node& node) {
  build_unary(builder, node, [](const Lane& x) noexcept { return lane_sigmoid(x); });
}

void build_erf(Builder& builder, const Node& node) {
  build_unary(builder, node,
              [](const Lane& x) noexcept -> Lane { return x.unaryExpr([](float v) { return std::erf(v); }); });
}

void build_leaky_relu(Builder& builder, const Node& node) {
  build_unary(builder, node, [slope = node.number("alpha", 0.01F)](const Lane& x) noexcept -> Lane {
    return lane_relu(x) + slope * lane_min(x, Lane::Zero());
  });
}

void build_clip(Builder& builder, const Node& node) {
  // Bounds are inputs since opset 11, attributes before; each may be missing.
  const auto bound = [&node](std::size_t input, std::string_view attribute, float otherwise) {
    if (!node.has_input(input)) return node.number(attribute, otherwise);
    const Value& value = node.float_input(input);
    if (!value.constant || elements(value.shape) != 1) node.refuse("its bounds must be single constants");
    return value.floats[0];
  };
  const float low = bound(1, "min", std::numeric_limits<float>::lowest());
  const float high = bound(2, "max", std::numeric_limits<float>::max());
  build_unary(builder, node, [low, high](const Lane& x) noexcept {
    return lane_min(lane_max(x, Lane::Constant(low)), Lane::Constant(high));
  });
}

}  // namespace takt::onnx_engine
