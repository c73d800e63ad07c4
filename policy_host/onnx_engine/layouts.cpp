// SPDX-License-Identifier: Apache-2.0
// Operators that repeat, fill or fold what they move: Tile, Pad, Trilu, DepthToSpace, SpaceToDepth.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/rearrange.hpp"
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();  // filled: no element of the input

// As rearrange(), with `fill` where the table has kNone.
void rearrange_or(Builder& builder, const Node& node, const Value& in, const Shape& shape,
                  std::vector<std::uint32_t> from, float fill) {
  if (in.type == ElementType::int64) {
    std::vector<std::int64_t> moved;
    for (const std::uint32_t i : from) moved.push_back(i == kNone ? static_cast<std::int64_t>(fill) : in.integers[i]);
    builder.define_integers(node.output(), shape, std::move(moved));
    return;
  }
  Value& out = builder.define_floats(node.output(), shape, in.type);
  builder.compute(out, {&in}, [from = std::move(from), source = in.floats, to = out.floats, fill]() noexcept {
    for (std::size_t i = 0; i < from.size(); ++i) to[i] = from[i] == kNone ? fill : source[from[i]];
  });
}

std::uint32_t offset_of(const std::vector<std::int64_t>& index, const std::vector<std::int64_t>& steps) {
  std::int64_t at = 0;
  for (std::size_t d = 0; d < steps.size(); ++d) at += index[d] * steps[d];
  return static_cast<std::uint32_t>(at);
}

}  // namespace

void build_tile(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::vector<std::int64_t>& repeats = node.integer_input(1);
  if (repeats.size() != in.shape.size()) node.refuse("its repeats have another rank than its input");
  Shape shape = in.shape;
  for (std::size_t d = 0; d < shape.size(); ++d) {
    if (repeats[d] < 1 || repeats[d] > static_cast<std::int64_t>(max_model_bytes))
      node.beyond(fmt::format("{} repeats are not supported", repeats[d]));
    shape[d] *= repeats[d];
    if (checked_elements(shape) < 0) node.beyond("its result is too large");
  }
  charge_table(builder, node, shape);
  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  rearrange(builder, node.output(), in, shape, table_of(shape, [&](std::vector<std::int64_t> index) {
              for (std::size_t d = 0; d < index.size(); ++d) index[d] %= in.shape[d];
              return offset_of(index, steps);
            }));
}

namespace {

enum class PadMode : std::uint8_t { constant, edge, reflect };

// Inputs since opset 11, attributes before.
std::vector<std::int64_t> pads_of(const Node& node, std::size_t rank) {
  const std::vector<std::int64_t> given =
      node.has_input(1) ? node.integer_input(1) : node.integers("pads").value_or(std::vector<std::int64_t>{});
  std::vector<std::int64_t> axes;
  if (node.has_input(3)) axes = node.integer_input(3);
  if (!node.has_input(3))
    for (std::size_t d = 0; d < rank; ++d) axes.push_back(static_cast<std::int64_t>(d));
  if (given.size() != 2 * axes.size()) node.refuse("its pads do not fit its axes");
  std::vector<std::int64_t> pads(2 * rank, 0);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const std::size_t d = node.axis(axes[i], rank);
    pads[d] = given[i];
    pads[rank + d] = given[axes.size() + i];
  }
  return pads;
}

float fill_of(const Node& node) {
  if (!node.has_input(2)) return node.number("value", 0.0F);
  const Value& value = node.input(2);
  if (!value.constant || elements(value.shape) != 1) node.beyond("it fills with what an input decides");
  return value.type == ElementType::int64 ? static_cast<float>(value.integers[0]) : value.floats[0];
}

PadMode mode_of(const Node& node) {
  const std::string mode = node.text("mode", "constant");
  if (mode == "constant") return PadMode::constant;
  if (mode == "edge") return PadMode::edge;
  if (mode == "reflect") return PadMode::reflect;
  node.beyond(fmt::format("mode '{}' is not supported", mode));
}

// Where in a dimension of `size` the place `at` is, which may lie outside; -1: nowhere.
std::int64_t padded_place(PadMode mode, std::int64_t at, std::int64_t size) {
  if (at >= 0 && at < size) return at;
  if (mode == PadMode::constant) return -1;
  if (mode == PadMode::edge || size == 1) return std::clamp<std::int64_t>(at, 0, size - 1);
  const std::int64_t period = 2 * (size - 1);
  const std::int64_t rest = ((at % period) + period) % period;
  return rest < size ? rest : period - rest;
}

}  // namespace

void build_pad(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::size_t rank = in.shape.size();
  const std::vector<std::int64_t> pads = pads_of(node, rank);
  const PadMode mode = mode_of(node);
  Shape shape = in.shape;
  for (std::size_t d = 0; d < rank; ++d) {
    for (const std::int64_t pad : {pads[d], pads[rank + d]})
      if (pad < -in.shape[d] || pad > static_cast<std::int64_t>(max_model_bytes))
        node.refuse(fmt::format("a pad of {} does not fit {}", pad, to_text(in.shape)));
    shape[d] += pads[d] + pads[rank + d];
    if (shape[d] < 1) node.beyond("nothing is left of a dimension");
    if (checked_elements(shape) < 0) node.beyond("its result is too large");
  }
  charge_table(builder, node, shape);
  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  std::vector<std::uint32_t> from = table_of(shape, [&](std::vector<std::int64_t> index) {
    for (std::size_t d = 0; d < rank; ++d) {
      index[d] = padded_place(mode, index[d] - pads[d], in.shape[d]);
      if (index[d] < 0) return kNone;
    }
    return offset_of(index, steps);
  });
  rearrange_or(builder, node, in, shape, std::move(from), fill_of(node));
}

void build_trilu(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::size_t rank = in.shape.size();
  if (rank < 2) node.refuse("its input is no matrix");
  std::int64_t diagonal = 0;
  if (node.has_input(1)) {
    if (node.integer_input(1).size() != 1) node.refuse("its diagonal must be one number");
    diagonal = node.integer_input(1)[0];
  }
  const bool upper = node.integer("upper", 1) != 0;
  charge_table(builder, node, in.shape);
  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  // Bounds far outside the matrix mean all or nothing of it.
  diagonal = std::clamp(diagonal, -in.shape[rank - 2] - 1, in.shape[rank - 1] + 1);
  std::vector<std::uint32_t> from = table_of(in.shape, [&](const std::vector<std::int64_t>& index) {
    const std::int64_t right = index[rank - 1] - index[rank - 2] - diagonal;
    return (upper ? right >= 0 : right <= 0) ? offset_of(index, steps) : kNone;
  });
  rearrange_or(builder, node, in, in.shape, std::move(from), 0.0F);
}

namespace {

// The input read as `folded`, its dimensions in `order`, as `shape`.
void fold(Builder& builder, const Node& node, const Shape& folded, const std::vector<std::size_t>& order,
          const Shape& shape) {
  const std::vector<std::int64_t> steps = row_major_steps(folded);
  Shape walk;
  std::vector<std::int64_t> walk_steps;
  for (const std::size_t d : order) {
    walk.push_back(folded[d]);
    walk_steps.push_back(steps[d]);
  }
  charge_table(builder, node, shape);
  rearrange(builder, node.output(), node.input(0), shape, strided_offsets(walk, walk_steps, 0));
}

std::int64_t block_size_of(const Node& node) {
  constexpr std::int64_t most = 1 << 20;
  const std::int64_t size = node.integer("blocksize", 0);
  if (size < 1 || size > most) node.refuse(fmt::format("a block size of {} is not supported", size));
  if (node.input(0).shape.size() != 4) node.refuse("its input has not four dimensions");
  return size;
}

}  // namespace

void build_depth_to_space(Builder& builder, const Node& node) {
  const std::int64_t size = block_size_of(node);
  const Shape& in = node.input(0).shape;
  if (in[1] % (size * size) != 0) node.refuse(fmt::format("{} does not fold by {}", to_text(in), size));
  const std::int64_t depth = in[1] / (size * size);
  const Shape shape{in[0], depth, in[2] * size, in[3] * size};
  const std::string mode = node.text("mode", "DCR");
  if (mode == "DCR") return fold(builder, node, {in[0], size, size, depth, in[2], in[3]}, {0, 3, 4, 1, 5, 2}, shape);
  if (mode != "CRD") node.beyond(fmt::format("mode '{}' is not supported", mode));
  fold(builder, node, {in[0], depth, size, size, in[2], in[3]}, {0, 1, 4, 2, 5, 3}, shape);
}

void build_space_to_depth(Builder& builder, const Node& node) {
  const std::int64_t size = block_size_of(node);
  const Shape& in = node.input(0).shape;
  if (in[2] % size != 0 || in[3] % size != 0) node.refuse(fmt::format("{} does not fold by {}", to_text(in), size));
  fold(builder, node, {in[0], in[1], in[2] / size, size, in[3] / size, size}, {0, 3, 5, 1, 2, 4},
       {in[0], in[1] * size * size, in[2] / size, in[3] / size});
}

}  // namespace takt::onnx_engine
