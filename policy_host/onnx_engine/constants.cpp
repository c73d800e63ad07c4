// SPDX-License-Identifier: Apache-2.0
// Operators whose result is known at load: Constant, ConstantOfShape, Shape, Size, Range; and Cast and CastLike between
// element types.
#include <fmt/format.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/screen.hpp"

namespace takt::onnx_engine {

namespace {

void define_numbers(Builder& builder, const std::string& name, const Shape& shape, const std::vector<float>& numbers) {
  Value& value = builder.define_floats(name, shape);
  std::ranges::copy(numbers, value.floats);
  value.constant = true;
}

Shape vector_shape(std::size_t size) {
  return {static_cast<std::int64_t>(size)};
}

}  // namespace

void build_constant(Builder& builder, const Node& node) {
  if (const onnx::TensorProto* value = node.tensor("value")) {
    define_constant(builder, node.output(), *value);
  } else if (node.has_attribute("value_float")) {
    define_numbers(builder, node.output(), {}, {node.number("value_float", 0.0F)});
  } else if (node.has_attribute("value_floats")) {
    const std::vector<float> numbers = node.numbers("value_floats");
    define_numbers(builder, node.output(), vector_shape(numbers.size()), numbers);
  } else if (node.has_attribute("value_int")) {
    builder.define_integers(node.output(), {}, {node.integer("value_int", 0)});
  } else if (const std::optional<std::vector<std::int64_t>> integers = node.integers("value_ints")) {
    builder.define_integers(node.output(), vector_shape(integers->size()), *integers);
  } else {
    node.beyond("only tensors, numbers and integers are supported as its value");
  }
}

void build_constant_of_shape(Builder& builder, const Node& node) {
  const Shape& shape = node.integer_input(0);
  const std::int64_t count = checked_elements(shape);
  if (count < 0) node.beyond(fmt::format("shape {} is too large", to_text(shape)));
  Value fill{.type = ElementType::float32, .shape = {1}, .integers = {}};
  float zero = 0.0F;
  fill.floats = &zero;
  if (const onnx::TensorProto* value = node.tensor("value")) {
    fill = define_constant(builder, "", *value);
    if (elements(fill.shape) != 1) node.refuse("its value must be one element");
  }
  if (fill.type == ElementType::int64) {
    builder.charge(static_cast<std::size_t>(count) * sizeof(std::int64_t));
    builder.define_integers(node.output(), shape,
                            std::vector<std::int64_t>(static_cast<std::size_t>(count), fill.integers[0]));
    return;
  }
  Value& out = builder.define_floats(node.output(), shape, fill.type);
  std::fill_n(out.floats, count, *fill.floats);
  out.constant = true;
}

void build_shape(Builder& builder, const Node& node) {
  const Shape& shape = node.input(0).shape;
  const auto rank = static_cast<std::int64_t>(shape.size());
  // Part of the shape since opset 15; bounds are clamped.
  const auto bound = [rank](std::int64_t at) { return std::clamp<std::int64_t>(at < 0 ? at + rank : at, 0, rank); };
  const std::int64_t start = bound(node.integer("start", 0));
  const std::int64_t end = std::max(start, bound(node.integer("end", rank)));
  std::vector<std::int64_t> part(shape.begin() + start, shape.begin() + end);
  const Shape result = vector_shape(part.size());
  builder.define_integers(node.output(), result, std::move(part));
}

void build_size(Builder& builder, const Node& node) {
  builder.define_integers(node.output(), {}, {static_cast<std::int64_t>(elements(node.input(0).shape))});
}

namespace {

const Value& one_constant(const Node& node, std::size_t input) {
  const Value& value = node.input(input);
  if (!value.constant || elements(value.shape) != 1) node.beyond("its bounds must be single constants");
  return value;
}

std::size_t count_of_range(const Node& node, double start, double limit, double step) {
  if (step == 0.0) node.refuse("its step is 0");
  const double count = std::ceil((limit - start) / step);
  constexpr double most = static_cast<double>(max_model_bytes) / sizeof(std::int64_t);
  if (!(count < most)) node.beyond(fmt::format("{} elements are too many", count));
  return count > 0.0 ? static_cast<std::size_t>(count) : 0;
}

}  // namespace

void build_range(Builder& builder, const Node& node) {
  const Value &start = one_constant(node, 0), &limit = one_constant(node, 1), &step = one_constant(node, 2);
  if (start.type != limit.type || start.type != step.type) node.refuse("its bounds differ in data type");
  if (start.type == ElementType::int64) {
    const std::int64_t first = start.integers[0], by = step.integers[0];
    const std::size_t count = count_of_range(node, static_cast<double>(first), static_cast<double>(limit.integers[0]),
                                             static_cast<double>(by));
    builder.charge(count * sizeof(std::int64_t));
    std::vector<std::int64_t> integers(count);
    for (std::size_t i = 0; i < count; ++i)
      integers[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(first) +
                                              static_cast<std::uint64_t>(by) * i);  // no overflow: below the limit
    const Shape shape = vector_shape(count);
    builder.define_integers(node.output(), shape, std::move(integers));
    return;
  }
  if (start.type != ElementType::float32) node.refuse("its bounds must be numbers");
  const float first = start.floats[0], by = step.floats[0];
  const std::size_t count =
      count_of_range(node, static_cast<double>(first), static_cast<double>(limit.floats[0]), static_cast<double>(by));
  builder.charge(count * sizeof(float));
  std::vector<float> floats(count);
  for (std::size_t i = 0; i < count; ++i) floats[i] = first + by * static_cast<float>(i);
  define_numbers(builder, node.output(), vector_shape(count), floats);
}

namespace {

bool is_integer(ElementType type) {
  return type == ElementType::int64 || type == ElementType::live_int64;
}

ElementType cast_target(const Node& node, const Value& in) {
  switch (node.integer("to", 0)) {
    case onnx::TensorProto_DataType_FLOAT:
    case onnx::TensorProto_DataType_DOUBLE:
      return ElementType::float32;
    case onnx::TensorProto_DataType_INT32:
    case onnx::TensorProto_DataType_INT64:
      return in.constant ? ElementType::int64 : ElementType::live_int64;
    case onnx::TensorProto_DataType_BOOL:
      return ElementType::boolean;
    default:
      node.beyond("casts only to FLOAT, DOUBLE, INT32, INT64 and BOOL are supported");
  }
}

// Elements that live as floats, from type to type; no whole number changes on the way to float32.
void cast_floats(Builder& builder, const Node& node, const Value& in, ElementType target) {
  Value& out = builder.define_floats(node.output(), in.shape, target);
  const bool truth = target == ElementType::boolean;
  const bool whole = target == ElementType::live_int64;
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, count = elements(in.shape), truth, whole]() noexcept {
    for (std::size_t i = 0; i < count; ++i) {
      const float x = from[i];
      const float is_true = std::isnan(x) ? x : (x == 0.0F ? 0.0F : 1.0F);
      to[i] = truth ? is_true : (whole ? std::trunc(x) : x);
    }
  });
}

void cast_to_known_integers(Builder& builder, const Node& node, const Value& in) {
  std::vector<std::int64_t> integers;
  for (std::size_t i = 0; i < elements(in.shape); ++i) {
    constexpr float beyond = 9.2e18F;
    if (!(std::abs(in.floats[i]) < beyond)) node.refuse("its input does not fit into INT64");
    integers.push_back(static_cast<std::int64_t>(in.floats[i]));
  }
  builder.define_integers(node.output(), in.shape, std::move(integers));
}

}  // namespace

namespace {

void build_cast_to(Builder& builder, const Node& node, const Value& in, ElementType target) {
  if (in.type == target || (is_integer(in.type) && is_integer(target))) {
    builder.define_view(node.output(), in.shape, in);
  } else if (in.type != ElementType::int64) {
    if (target == ElementType::int64) return cast_to_known_integers(builder, node, in);
    cast_floats(builder, node, in, target);
  } else {
    Value& out = builder.define_floats(node.output(), in.shape, target);
    const bool truth = target == ElementType::boolean;
    std::ranges::transform(in.integers, out.floats, [truth](std::int64_t i) {
      return truth ? static_cast<float>(i != 0) : static_cast<float>(i);
    });
    out.constant = true;
  }
}

}  // namespace

void build_cast(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  build_cast_to(builder, node, in, cast_target(node, in));
}

void build_cast_like(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const ElementType like = node.input(1).type;
  const ElementType whole = in.constant ? ElementType::int64 : ElementType::live_int64;
  build_cast_to(builder, node, in, is_integer(like) ? whole : like);
}

}  // namespace takt::onnx_engine
