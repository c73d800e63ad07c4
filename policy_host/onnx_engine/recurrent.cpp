// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/recurrent.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "policy_host/onnx_engine/panels.hpp"

namespace takt::onnx_engine {

namespace {

std::size_t directions_of(const Node& node, const std::string& direction) {
  if (direction == "forward" || direction == "reverse") return 1;
  if (direction == "bidirectional") return 2;
  node.refuse(fmt::format("direction '{}' is not supported", direction));
}

void refuse_variants(const Node& node, std::size_t directions, const std::vector<std::string>& activations) {
  const std::vector<std::string> given = node.texts("activations");
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (given.size() != activations.size() * directions || given[i] != activations[i % activations.size()]) {
      node.beyond("other activations than the default ones are not supported");
    }
  }
  if (node.has_attribute("clip")) node.beyond("clip is not supported");
  if (node.integer("input_forget", 0) != 0) node.beyond("coupled input and forget gates are not supported");
  if (node.integer("layout", 0) != 0) node.beyond("only layout 0 is supported");
  if (node.has_input(4)) node.beyond("sequence lengths are not supported; export it for one length");
  if (node.has_input(7)) node.beyond("peepholes are not supported");
}

const Value& constant_weight(const Node& node, std::size_t index, const Shape& shape) {
  const Value& value = node.float_input(index);
  if (!value.constant) node.beyond(fmt::format("input {} must be constant weights", index));
  if (value.shape != shape) {
    node.refuse(fmt::format("input {} has shape {} in place of {}", index, to_text(value.shape), to_text(shape)));
  }
  return value;
}

std::int64_t dimension(std::size_t size) {
  return static_cast<std::int64_t>(size);
}

}  // namespace

RecurrentShape::RecurrentShape(const Node& node, std::size_t gates, const std::vector<std::string>& activations) {
  const std::string direction = node.text("direction", "forward");
  directions = directions_of(node, direction);
  backward_only_ = direction == "reverse";
  refuse_variants(node, directions, activations);
  const Shape& x = node.float_input(0).shape;
  const Shape& r = node.float_input(2).shape;
  if (x.size() != 3 || r.size() != 3) node.refuse("its input and recurrent weights must have three dimensions");
  sequence = static_cast<std::size_t>(x[0]);
  batch = static_cast<std::size_t>(x[1]);
  input = static_cast<std::size_t>(x[2]);
  hidden = static_cast<std::size_t>(r[2]);
  if (node.integer("hidden_size", r[2]) != r[2]) node.refuse("hidden_size differs from its recurrent weights");
  constant_weight(node, 1, {dimension(directions), dimension(gates * hidden), dimension(input)});
  constant_weight(node, 2, {dimension(directions), dimension(gates * hidden), dimension(hidden)});
}

PackedWeights pack_gates(Builder& builder, const Node& node, std::size_t index, const RecurrentShape& shape,
                         std::size_t gates, std::size_t direction, std::size_t first, std::size_t count) {
  const Value& weight = node.float_input(index);
  const std::size_t inner = static_cast<std::size_t>(weight.shape[2]);
  const std::size_t columns = count * shape.hidden;
  const float* from = weight.floats + (direction * gates + first) * shape.hidden * inner;
  const float* panels = builder.constant(packed_size(inner, columns),
                                         [&](float* packed) { pack_panels(from, inner, columns, 1, inner, packed); });
  return {panels, inner, columns};
}

Biases gate_biases(Builder& builder, const Node& node, const RecurrentShape& shape, std::size_t gates,
                   std::size_t direction) {
  const std::size_t half = gates * shape.hidden;
  if (!node.has_input(3)) {
    const float* zeros = builder.allocate(half);
    return {zeros, zeros};
  }
  const Value& bias = constant_weight(node, 3, {dimension(shape.directions), dimension(2 * half)});
  const float* first = bias.floats + direction * 2 * half;
  return {first, first + half};
}

void note_lost_state(Builder& builder, const Node& node, const RecurrentShape& shape) {
  const bool decided = node.has_input(5) && !node.input(5).constant;
  if (shape.sequence == 1 && !decided) builder.report_lost_state(node.description());
}

float* define_state(Builder& builder, const Node& node, std::size_t input, std::size_t output,
                    const RecurrentShape& shape) {
  const Shape dims{dimension(shape.directions), dimension(shape.batch), dimension(shape.hidden)};
  const float* initial = nullptr;
  if (node.has_input(input)) {
    const Value& given = node.float_input(input);
    if (given.shape != dims) {
      node.refuse(fmt::format("initial state of shape {} in place of {}", to_text(given.shape), to_text(dims)));
    }
    initial = given.floats;
  }
  float* state = builder.define_floats(node.output(output), dims).floats;
  builder.each_run([initial, state, count = elements(dims)]() noexcept {
    if (initial == nullptr) {
      std::fill_n(state, count, 0.0F);
    } else {
      std::copy_n(initial, count, state);
    }
  });
  return state;
}

float* define_sequence_output(Builder& builder, const Node& node, const RecurrentShape& shape) {
  return builder
      .define_floats(node.output(), {dimension(shape.sequence), dimension(shape.directions), dimension(shape.batch),
                                     dimension(shape.hidden)})
      .floats;
}

}  // namespace takt::onnx_engine
