// SPDX-License-Identifier: Apache-2.0
// Operators that only rename a shape: the elements stay where they are, and nothing happens on a run.
#include <fmt/format.h>

#include <algorithm>

#include "policy_host/onnx_engine/operators.hpp"

namespace takt::onnx_engine {

void build_identity(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  builder.define_view(node.output(), in.shape, in);
}

// Of a trained network: as it is.
void build_dropout(Builder& builder, const Node& node) {
  if (node.has_output(1)) node.beyond("its mask as an output is not supported");
  if (node.has_input(2)) {
    const Value& training = node.input(2);
    if (!training.constant || training.type != ElementType::boolean || training.floats[0] != 0.0F)
      node.beyond("training is not supported");
  }
  const Value& in = node.input(0);
  builder.define_view(node.output(), in.shape, in);
}

void build_reshape(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  Shape shape = node.integer_input(1);
  if (shape.size() > max_rank) node.beyond(fmt::format("more than {} dimensions", max_rank));
  const bool zero_means_zero = node.integer("allowzero", 0) != 0;
  for (std::size_t d = 0; d < shape.size(); ++d) {
    if (shape[d] != 0 || zero_means_zero) continue;
    if (d >= in.shape.size()) node.refuse("a dimension of 0 keeps one that the input does not have");
    shape[d] = in.shape[d];
  }
  const auto open = std::ranges::find(shape, -1);
  if (open != shape.end()) {
    *open = 1;
    const std::int64_t known = checked_elements(shape);
    const auto count = static_cast<std::int64_t>(elements(in.shape));
    if (known <= 0 || count % known != 0) {
      node.refuse(fmt::format("{} elements do not fill shape {}", count, to_text(node.integer_input(1))));
    }
    *open = count / known;
  }
  builder.define_view(node.output(), shape, in);
}

void build_flatten(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::int64_t axis = node.integer("axis", 1);
  const std::size_t rank = in.shape.size();
  // The axis may also point behind the last dimension.
  const std::size_t split = axis == static_cast<std::int64_t>(rank) ? rank : node.axis(axis, rank);
  const Shape shape{static_cast<std::int64_t>(elements_between(in.shape, 0, split)),
                    static_cast<std::int64_t>(elements_between(in.shape, split, rank))};
  builder.define_view(node.output(), shape, in);
}

void build_squeeze(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::optional<std::vector<std::int64_t>> axes = node.axes(1);
  std::vector<bool> drop(in.shape.size(), false);
  if (axes) {
    for (const std::int64_t axis : *axes) drop[node.axis(axis, in.shape.size())] = true;
  } else {
    for (std::size_t d = 0; d < drop.size(); ++d) drop[d] = in.shape[d] == 1;
  }
  Shape shape;
  for (std::size_t d = 0; d < drop.size(); ++d) {
    if (!drop[d]) shape.push_back(in.shape[d]);
    if (drop[d] && in.shape[d] != 1) node.refuse(fmt::format("dimension {} of {} is not 1", d, to_text(in.shape)));
  }
  builder.define_view(node.output(), shape, in);
}

void build_unsqueeze(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::optional<std::vector<std::int64_t>> axes = node.axes(1);
  if (!axes || axes->size() > max_rank) node.refuse("its axes are missing or too many");
  const std::size_t rank = in.shape.size() + axes->size();
  std::vector<bool> added(rank, false);
  for (const std::int64_t axis : *axes) {
    const std::size_t d = node.axis(axis, rank);
    if (added[d]) node.refuse(fmt::format("axis {} is given twice", axis));
    added[d] = true;
  }
  Shape shape;
  auto next = in.shape.begin();
  for (std::size_t d = 0; d < rank; ++d) shape.push_back(added[d] ? 1 : *next++);
  builder.define_view(node.output(), shape, in);
}

}  // namespace takt::onnx_engine
