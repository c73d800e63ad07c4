// SPDX-License-Identifier: Apache-2.0
// Operators that take or put elements by an index for each: GatherElements, GatherND, ScatterElements, ScatterND,
// OneHot.
//
// Indices are known at load; those of GatherElements and OneHot may be what an input decides. There one outside the
// dimension, like not a number, takes not a number.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/rearrange.hpp"
#include "policy_host/onnx_engine/strides.hpp"

namespace takt::onnx_engine {

namespace {

std::int64_t settled(const Node& node, std::int64_t index, std::int64_t size) {
  if (index < -size || index >= size) node.refuse(fmt::format("index {} is outside 0..{}", index, size - 1));
  return index < 0 ? index + size : index;
}

// Of each index of `shape`: where in a tensor of `steps` it is, its place along `axis` left out.
std::vector<std::uint32_t> starts_of(const Shape& shape, std::vector<std::int64_t> steps, std::size_t axis) {
  steps[axis] = 0;
  return strided_offsets(shape, steps, 0);
}

void need_within(const Node& node, const Shape& indices, const Shape& data, std::size_t axis) {
  bool fits = indices.size() == data.size();
  for (std::size_t d = 0; fits && d < data.size(); ++d) fits = d == axis || indices[d] <= data[d];
  if (!fits) node.refuse(fmt::format("indices of shape {} do not fit {}", to_text(indices), to_text(data)));
}

}  // namespace

void build_gather_elements(Builder& builder, const Node& node) {
  const Value &in = node.input(0), &indices = node.input(1);
  if (in.shape.empty()) node.refuse("a scalar has no axis");
  const std::size_t axis = node.axis(node.integer("axis", 0), in.shape.size());
  need_within(node, indices.shape, in.shape, axis);
  charge_table(builder, node, indices.shape);
  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  std::vector<std::uint32_t> starts = starts_of(indices.shape, steps, axis);
  const std::int64_t size = in.shape[axis], step = steps[axis];
  if (indices.type == ElementType::int64) {
    for (std::size_t i = 0; i < starts.size(); ++i)
      starts[i] += static_cast<std::uint32_t>(settled(node, indices.integers[i], size) * step);
    return rearrange(builder, node.output(), in, indices.shape, std::move(starts));
  }
  if (indices.type != ElementType::live_int64) node.refuse("its indices must be integers");
  if (in.type == ElementType::int64) node.beyond("int64 by an index that an input decides is not supported");
  Value& out = builder.define_floats(node.output(), indices.shape, in.type);
  builder.compute(out, {&in, &indices},
                  [from = in.floats, by = indices.floats, to = out.floats, starts = std::move(starts),
                   rows = static_cast<float>(size), step = static_cast<std::size_t>(step)]() noexcept {
                    for (std::size_t i = 0; i < starts.size(); ++i) {
                      const bool inside = by[i] >= -rows && by[i] < rows;
                      const float row = by[i] < 0.0F ? by[i] + rows : by[i];
                      to[i] = inside ? from[starts[i] + static_cast<std::size_t>(row) * step]
                                     : std::numeric_limits<float>::quiet_NaN();
                    }
                  });
}

namespace {

// Of GatherND and ScatterND: where each row of indices points in `data`, and how many elements follow there.
struct Slices {
  std::vector<std::uint32_t> starts;
  std::size_t length = 1;
  Shape shape;  // of all slices together
};

Slices slices_of(Builder& builder, const Node& node, const Shape& data, std::size_t batch) {
  const Value& indices = node.input(1);
  const std::vector<std::int64_t>& numbers = node.integer_input(1);
  if (indices.shape.empty() || indices.shape.size() <= batch || data.size() <= batch)
    node.refuse("its indices have too few dimensions");
  const auto depth = static_cast<std::size_t>(indices.shape.back());
  if (depth < 1 || batch + depth > data.size()) node.refuse("its indices have more numbers than its input dimensions");
  for (std::size_t d = 0; d < batch; ++d)
    if (indices.shape[d] != data[d]) node.refuse("its indices and its input differ in their batches");
  const std::vector<std::int64_t> steps = row_major_steps(data);
  Slices slices;
  slices.length = elements_between(data, batch + depth, data.size());
  slices.shape.assign(indices.shape.begin(), indices.shape.end() - 1);
  slices.shape.insert(slices.shape.end(), data.begin() + static_cast<std::ptrdiff_t>(batch + depth), data.end());
  charge_table(builder, node, slices.shape);
  const std::size_t rows = numbers.size() / depth;
  const std::size_t batches = elements_between(data, 0, batch);
  const std::size_t batch_step = elements_between(data, batch, data.size());
  for (std::size_t r = 0; r < rows; ++r) {
    std::size_t at = r / (rows / batches) * batch_step;
    for (std::size_t k = 0; k < depth; ++k)
      at += static_cast<std::size_t>(settled(node, numbers[r * depth + k], data[batch + k]) * steps[batch + k]);
    slices.starts.push_back(static_cast<std::uint32_t>(at));
  }
  return slices;
}

}  // namespace

void build_gather_nd(Builder& builder, const Node& node) {
  const Value& in = node.input(0);
  const std::int64_t batch = node.integer("batch_dims", 0);
  if (batch < 0 || batch > static_cast<std::int64_t>(max_rank)) node.refuse("its batch_dims do not fit its input");
  const Slices slices = slices_of(builder, node, in.shape, static_cast<std::size_t>(batch));
  std::vector<std::uint32_t> from;
  for (const std::uint32_t start : slices.starts)
    for (std::size_t i = 0; i < slices.length; ++i) from.push_back(start + static_cast<std::uint32_t>(i));
  rearrange(builder, node.output(), in, slices.shape, std::move(from));
}

namespace {

// `updates` put into a copy of `in`, one after the other, at `places`; added where the node says so.
void scatter(Builder& builder, const Node& node, const Value& in, const Value& updates,
             std::vector<std::uint32_t> places) {
  const std::string reduction = node.text("reduction", "none");
  if (reduction != "none" && reduction != "add") node.beyond(fmt::format("reduction '{}' is not supported", reduction));
  if (in.type != updates.type || in.type == ElementType::int64)
    node.beyond("only float32 and bool, of input and updates alike, are supported");
  Value& out = builder.define_floats(node.output(), in.shape, in.type);
  builder.compute(out, {&in, &updates},
                  [from = in.floats, by = updates.floats, to = out.floats, size = elements(in.shape),
                   places = std::move(places), adds = reduction == "add"]() noexcept {
                    std::copy_n(from, size, to);
                    for (std::size_t i = 0; i < places.size(); ++i)
                      to[places[i]] = adds ? to[places[i]] + by[i] : by[i];
                  });
}

}  // namespace

void build_scatter_elements(Builder& builder, const Node& node) {
  const Value &in = node.input(0), &indices = node.input(1), &updates = node.input(2);
  if (in.shape.empty()) node.refuse("a scalar has no axis");
  const std::size_t axis = node.axis(node.integer("axis", 0), in.shape.size());
  need_within(node, indices.shape, in.shape, axis);
  if (updates.shape != indices.shape) node.refuse("its indices and its updates differ in shape");
  const std::vector<std::int64_t>& numbers = node.integer_input(1);
  charge_table(builder, node, indices.shape);
  const std::vector<std::int64_t> steps = row_major_steps(in.shape);
  std::vector<std::uint32_t> places = starts_of(indices.shape, steps, axis);
  for (std::size_t i = 0; i < places.size(); ++i)
    places[i] += static_cast<std::uint32_t>(settled(node, numbers[i], in.shape[axis]) * steps[axis]);
  scatter(builder, node, in, updates, std::move(places));
}

void build_scatter_nd(Builder& builder, const Node& node) {
  const Value &in = node.input(0), &updates = node.input(2);
  const Slices slices = slices_of(builder, node, in.shape, 0);
  if (updates.shape != slices.shape)
    node.refuse(fmt::format("updates of shape {} do not fit {}", to_text(updates.shape), to_text(slices.shape)));
  std::vector<std::uint32_t> places;
  for (const std::uint32_t start : slices.starts)
    for (std::size_t i = 0; i < slices.length; ++i) places.push_back(start + static_cast<std::uint32_t>(i));
  scatter(builder, node, in, updates, std::move(places));
}

namespace {

// Of OneHot, whose depth may be a float.
std::int64_t depth_of(const Node& node) {
  const Value& depth = node.input(1);
  if (!depth.constant || elements(depth.shape) != 1) node.beyond("its depth must be one constant");
  const double value =
      depth.type == ElementType::int64 ? static_cast<double>(depth.integers[0]) : static_cast<double>(depth.floats[0]);
  constexpr double most = 1 << 24;
  if (!(value >= 1 && value <= most)) node.beyond(fmt::format("a depth of {} is not supported", value));
  return static_cast<std::int64_t>(value);
}

}  // namespace

void build_one_hot(Builder& builder, const Node& node) {
  Value indices = node.input(0);
  const Value& values = node.float_input(2);
  if (elements(values.shape) != 2) node.refuse("its values must be two: off and on");
  const std::int64_t depth = depth_of(node);
  if (indices.type == ElementType::int64) {
    Value& known = builder.define_floats("", indices.shape);
    std::ranges::transform(indices.integers, known.floats, [](std::int64_t i) { return static_cast<float>(i); });
    known.constant = true;
    indices = known;
  }
  Shape shape = indices.shape;
  const std::size_t axis = node.axis(node.integer("axis", -1), shape.size() + 1);
  shape.insert(shape.begin() + static_cast<std::ptrdiff_t>(axis), depth);
  Value& out = builder.define_floats(node.output(), shape);
  builder.compute(
      out, {&indices, &values},
      [by = indices.floats, off_on = values.floats, to = out.floats, outer = elements_between(shape, 0, axis),
       rows = static_cast<std::size_t>(depth), inner = elements_between(shape, axis + 1, shape.size())]() noexcept {
        for (std::size_t o = 0; o < outer; ++o) {
          for (std::size_t i = 0; i < inner; ++i) {
            const float index = by[o * inner + i];
            const float row = index < 0.0F ? index + static_cast<float>(rows) : index;
            for (std::size_t r = 0; r < rows; ++r) {
              const bool hot = row == static_cast<float>(r);
              to[(o * rows + r) * inner + i] = std::isnan(index) ? index : off_on[hot ? 1 : 0];
            }
          }
        }
      });
}

}  // namespace takt::onnx_engine
