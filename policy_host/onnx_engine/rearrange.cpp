// SPDX-License-Identifier: Apache-2.0
// Operators that move elements without changing them: Transpose, Slice, Split, Gather, Expand, Concat.
//
// All but Concat, and a Gather whose index an input decides, are one table: for each element of the result, where it
// comes from.
#include "policy_host/onnx_engine/rearrange.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "policy_host/onnx_engine/broadcast.hpp"
#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

void rearrange(Builder& builder, const std::string& name, const Value& in, const Shape& shape,
               std::vector<std::uint32_t> from) {
  if (in.type == ElementType::int64) {
    std::vector<std::int64_t> moved;
    for (const std::uint32_t i : from) moved.push_back(in.integers[i]);
    builder.define_integers(name, shape, std::move(moved));
    return;
  }
  Value& out = builder.define_floats(name, shape, in.type);
  builder.compute(out, {&in}, [from = std::move(from), source = in.floats, to = out.floats]() noexcept {
    for (std::size_t i = 0; i < from.size(); ++i) to[i] = source[from[i]];
  });
}

void charge_table(Builder& builder, const Node& node, const Shape& shape) {
  const std::int64_t count = checked_elements(shape);
  if (count < 0) node.beyond(fmt::format("a result of shape {} is too large", to_text(shape)));
  builder.charge(static_cast<std::size_t>(count) * sizeof(std::uint32_t));
}

namespace {

void rearrange_strided(Builder& builder, const Node& node, const Value& in, const Shape& shape,
                       const std::vector<std::int64_t>& steps, std::int64_t first, std::size_t output = 0) {
  charge_table(builder, node, shape);
  rearrange(builder, node.output(output), in, shape, strided_offsets(shape, steps, first));
}

struct Cut {
  std::int64_t first;
  std::int64_t count;
  std::int64_t step;
};

// The elements start, start + step, ... before end of a dimension, out-of-range bounds clamped as NumPy does.
Cut cut(std::int64_t start, std::int64_t end, std::int64_t step, std::int64_t size) {
  if (size == 0) return {0, 0, 1};
  const bool forward = step > 0;
  const std::int64_t highest = forward ? size : size - 1;
  start = std::clamp<std::int64_t>(start < 0 ? start + size : start, 0, highest);
  end = std::clamp<std::int64_t>(end < 0 ? end + size : end, forward ? 0 : -1, highest);
  const std::int64_t distance = forward ? end - start : start - end;
  if (distance <= 0) return {0, 0, 1};
  // A step beyond the dimension takes one element, however far it goes.
  step = std::clamp(step, -size, size);
  return {start, (distance - 1) / (forward ? step : -step) + 1, step};
}

std::vector<std::int64_t> slice_parameter(const Node& node, std::size_t input, std::string_view attribute) {
  if (node.has_input(input)) return node.integer_input(input);
  return node.integers(attribute).value_or(std::vector<std::int64_t>{});
}

template <class Element>
struct Block {
  const Element* from;
  std::size_t length;  // elements it gives to each row of the result
};

template <class Element>
void join(const std::vector<Block<Element>>& blocks, std::size_t rows, Element* to) noexcept {
  for (std::size_t r = 0; r < rows; ++r) {
    for (const Block<Element>& block : blocks) {
      to = std::copy_n(block.from + r * block.length, block.length, to);
    }
  }
}

}  // namespace

void build_transpose(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::size_t rank = in.shape.size();
  std::vector<std::int64_t> order(rank);
  for (std::size_t d = 0; d < rank; ++d) order[d] = static_cast<std::int64_t>(rank - 1 - d);
  order = node.integers("perm").value_or(order);
  if (order.size() != rank) node.refuse("its permutation has another rank than its input");
  const std::vector<std::int64_t> source_steps = row_major_steps(in.shape);
  Shape shape;
  std::vector<std::int64_t> steps;
  std::vector<bool> seen(rank, false);
  for (const std::int64_t axis : order) {
    const std::size_t d = node.axis(axis, rank);
    if (seen[d]) node.refuse("its permutation names an axis twice");
    seen[d] = true;
    shape.push_back(in.shape[d]);
    steps.push_back(source_steps[d]);
  }
  rearrange_strided(builder, node, in, shape, steps, 0);
}

void build_slice(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  // Inputs since opset 10, attributes before.
  const std::vector<std::int64_t> starts = slice_parameter(node, 1, "starts");
  const std::vector<std::int64_t> ends = slice_parameter(node, 2, "ends");
  std::vector<std::int64_t> axes = slice_parameter(node, 3, "axes");
  std::vector<std::int64_t> given_steps = slice_parameter(node, 4, "steps");
  if (starts.size() > in.shape.size()) node.refuse("it cuts more axes than its input has");
  for (std::size_t i = axes.size(); i < starts.size(); ++i) axes.push_back(static_cast<std::int64_t>(i));
  given_steps.resize(given_steps.empty() ? starts.size() : given_steps.size(), 1);
  if (ends.size() != starts.size() || axes.size() != starts.size() || given_steps.size() != starts.size()) {
    node.refuse("its starts, ends, axes and steps differ in number");
  }
  Shape shape = in.shape;
  std::vector<std::int64_t> steps = row_major_steps(in.shape);
  std::vector<bool> seen(shape.size(), false);
  std::int64_t first = 0;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const std::size_t d = node.axis(axes[i], shape.size());
    if (seen[d] || given_steps[i] == 0) node.refuse("it cuts an axis twice, or with a step of 0");
    seen[d] = true;
    const Cut part = cut(starts[i], ends[i], given_steps[i], shape[d]);
    shape[d] = part.count;
    first += part.first * steps[d];
    steps[d] *= part.step;
  }
  rearrange_strided(builder, node, in, shape, steps, first);
}

namespace {

Shape gathered_shape(const Shape& shape, std::size_t axis, const Shape& indices) {
  const auto split = shape.begin() + static_cast<std::ptrdiff_t>(axis);
  Shape result(shape.begin(), split);
  result.insert(result.end(), indices.begin(), indices.end());
  result.insert(result.end(), split + 1, shape.end());
  return result;
}

// The index an input decides is beyond what a load can check: one outside the dimension, like not a number, gathers not
// a number.
void gather_live(Builder& builder, const Node& node, const Value& in, const Value& indices, std::size_t axis) {
  if (in.type == ElementType::int64) node.beyond("int64 by an index that an input decides is not supported");
  Value& out = builder.define_floats(node.output(), gathered_shape(in.shape, axis, indices.shape), in.type);
  builder.compute(out, {&in, &indices},
                  [from = in.floats, index = indices.floats, to = out.floats, count = elements(indices.shape),
                   outer = elements_between(in.shape, 0, axis), size = static_cast<std::size_t>(in.shape[axis]),
                   inner = elements_between(in.shape, axis + 1, in.shape.size())]() noexcept {
                    const auto rows = static_cast<float>(size);
                    float* next = to;
                    for (std::size_t o = 0; o < outer; ++o) {
                      for (std::size_t i = 0; i < count; ++i, next += inner) {
                        const bool inside = index[i] >= -rows && index[i] < rows;
                        if (!inside) {
                          std::fill_n(next, inner, std::numeric_limits<float>::quiet_NaN());
                          continue;
                        }
                        const float row = index[i] < 0.0F ? index[i] + rows : index[i];
                        std::copy_n(from + (o * size + static_cast<std::size_t>(row)) * inner, inner, next);
                      }
                    }
                  });
}

}  // namespace

void build_gather(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const Value& indices = node.input(1);
  const std::size_t axis = node.axis(node.integer("axis", 0), in.shape.size());
  if (indices.type == ElementType::live_int64) return gather_live(builder, node, in, indices, axis);
  std::vector<std::size_t> rows;
  for (const std::int64_t index : node.integer_input(1)) {
    const std::int64_t size = in.shape[axis];
    if (index < -size || index >= size) node.refuse(fmt::format("index {} is outside 0..{}", index, size - 1));
    rows.push_back(static_cast<std::size_t>(index < 0 ? index + size : index));
  }
  const Shape shape = gathered_shape(in.shape, axis, indices.shape);
  charge_table(builder, node, shape);

  const std::size_t inner = elements_between(in.shape, axis + 1, in.shape.size());
  const std::size_t size = static_cast<std::size_t>(in.shape[axis]);
  std::vector<std::uint32_t> from;
  for (std::size_t o = 0; o < elements_between(in.shape, 0, axis); ++o) {
    for (const std::size_t row : rows) {
      for (std::size_t i = 0; i < inner; ++i) from.push_back(static_cast<std::uint32_t>((o * size + row) * inner + i));
    }
  }
  rearrange(builder, node.output(), in, shape, std::move(from));
}

namespace {

// How long each part of a dimension of `size` is: as the node says, else equal ones, the last one what is left.
std::vector<std::int64_t> part_lengths(const Node& node, std::int64_t size) {
  std::vector<std::int64_t> given = slice_parameter(node, 1, "split");
  const auto parts = static_cast<std::int64_t>(node.output_count());
  if (!given.empty()) {
    std::int64_t left = size;
    for (const std::int64_t length : given) {
      if (length < 0 || length > left) left = -1;
      if (left >= 0) left -= length;
    }
    if (left != 0 || std::ssize(given) != parts) {
      node.refuse(fmt::format("parts of {} do not make up {}, for {} outputs", to_text(given), size, parts));
    }
    return given;
  }
  if (node.integer("num_outputs", parts) != parts) node.refuse("num_outputs differs from its outputs");
  if (parts == 0 || (size % parts != 0 && !node.has_attribute("num_outputs"))) {
    node.refuse(fmt::format("{} does not divide into {} equal parts", size, parts));
  }
  const std::int64_t length = (size + parts - 1) / parts;
  std::vector<std::int64_t> lengths(static_cast<std::size_t>(parts), length);
  lengths.back() = size - (parts - 1) * length;
  if (lengths.back() < 0) node.refuse(fmt::format("{} does not divide into {} parts", size, parts));
  return lengths;
}

}  // namespace

void build_split(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::size_t axis = node.axis(node.integer("axis", 0), in.shape.size());
  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  std::int64_t begin = 0;
  std::size_t output = 0;
  for (const std::int64_t length : part_lengths(node, in.shape[axis])) {
    Shape shape = in.shape;
    shape[axis] = length;
    // A part of nothing is no value here; who reads it is refused.
    if (node.has_output(output) && length > 0)
      rearrange_strided(builder, node, in, shape, steps, begin * steps[axis], output);
    begin += length;
    ++output;
  }
}

void build_expand(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::optional<Shape> shape = broadcast_shape(in.shape, node.integer_input(1));
  if (!shape) node.refuse(fmt::format("{} does not expand to {}", to_text(in.shape), to_text(node.integer_input(1))));
  // Dimensions the input lacks, and those of 1 that grow, are walked without moving in the source.
  std::vector<std::int64_t> steps = row_major_steps(in.shape);
  for (std::size_t d = 0; d < steps.size(); ++d) {
    if (in.shape[d] == 1) steps[d] = 0;
  }
  steps.insert(steps.begin(), shape->size() - steps.size(), 0);
  rearrange_strided(builder, node, in, *shape, steps, 0);
}

void build_concat(Builder& builder, const Node& node) {
  const Value& first = node.input(0);
  const std::size_t axis = node.axis(node.integer("axis", 1), first.shape.size());
  Shape shape = first.shape;
  shape[axis] = 0;
  std::vector<const Value*> sources;
  std::vector<Block<float>> floats;
  std::vector<Block<std::int64_t>> integers;
  for (std::size_t i = 0; i < node.input_count(); ++i) {
    const Value& in = node.input(i);
    if (in.type != first.type) node.beyond("its inputs differ in data type");
    for (std::size_t d = 0; d < std::max(in.shape.size(), shape.size()); ++d) {
      if (in.shape.size() != shape.size() || (d != axis && in.shape[d] != shape[d])) {
        node.refuse(fmt::format("{} does not join {}", to_text(in.shape), to_text(first.shape)));
      }
    }
    shape[axis] += in.shape[axis];
    if (checked_elements(shape) < 0) node.beyond("its result is too large");
    const std::size_t length = elements_between(in.shape, axis, in.shape.size());
    sources.push_back(&in);
    floats.push_back({in.floats, length});
    integers.push_back({in.integers.data(), length});
  }
  const std::size_t rows = elements_between(shape, 0, axis);
  if (first.type == ElementType::int64) {
    std::vector<std::int64_t> joined(elements(shape));
    join(integers, rows, joined.data());
    builder.define_integers(node.output(), shape, std::move(joined));
    return;
  }
  Value& out = builder.define_floats(node.output(), shape, first.type);
  builder.compute(out, sources,
                  [floats = std::move(floats), rows, to = out.floats]() noexcept { join(floats, rows, to); });
}

}  // namespace takt::onnx_engine
