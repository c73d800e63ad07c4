// SPDX-License-Identifier: Apache-2.0
// Softmax, LogSoftmax, Hardmax; LayerNormalization, BatchNormalization, InstanceNormalization. Sums run in ascending
// order.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "policy_host/onnx_engine/lanes.hpp"
#include "policy_host/onnx_engine/operators.hpp"

namespace takt::onnx_engine {

namespace {

// One row of a softmax, in `row`; the largest element is subtracted first, so that exp cannot overflow.
void softmax_row(float* row, std::size_t length) noexcept {
  float largest = row[0];
  for (std::size_t i = 1; i < length; ++i) largest = std::max(largest, row[i]);
  map_lanes(row, row, length, [largest](const Lane& x) noexcept { return lane_exp(x - largest); });
  float sum = 0.0F;
  for (std::size_t i = 0; i < length; ++i) sum += row[i];
  for (std::size_t i = 0; i < length; ++i) row[i] /= sum;
}

void normalise_row(const float* in, float* out, std::size_t length, float epsilon) noexcept {
  const auto count = static_cast<float>(length);
  float sum = 0.0F;
  for (std::size_t i = 0; i < length; ++i) sum += in[i];
  const float mean = sum / count;
  float squares = 0.0F;
  for (std::size_t i = 0; i < length; ++i) {
    out[i] = in[i] - mean;
    squares += out[i] * out[i];
  }
  const float deviation = std::sqrt(squares / count + epsilon);
  for (std::size_t i = 0; i < length; ++i) out[i] /= deviation;
}

}  // namespace

namespace {

void log_softmax_row(float* row, std::size_t length) noexcept {
  float largest = row[0];
  for (std::size_t i = 1; i < length; ++i) largest = std::max(largest, row[i]);
  float sum = 0.0F;
  for (std::size_t i = 0; i < length; ++i) {
    row[i] -= largest;
    sum += std::exp(row[i]);
  }
  for (std::size_t i = 0; i < length; ++i) row[i] -= std::log(sum);
}

// 1 where the first of the largest is; not a number anywhere in the row is the whole of it.
void hardmax_row(float* row, std::size_t length) noexcept {
  std::size_t best = 0;
  float nan = 0.0F;
  for (std::size_t i = 0; i < length; ++i) {
    if (std::isnan(row[i])) nan = row[i];
    if (row[i] > row[best]) best = i;
  }
  std::fill_n(row, length, nan);
  row[best] += 1.0F;
}

using RunRow = void (*)(float* row, std::size_t length) noexcept;

void build_rows(Builder& builder, const Node& node, RunRow run) {
  const Value& in = node.float_input(0);
  const std::size_t rank = in.shape.size();
  // Before opset 13 everything from the axis on is one row; since then the axis alone is.
  const bool rest_is_row = builder.opset() < 13;
  const std::size_t axis = node.axis(node.integer("axis", rest_is_row ? 1 : -1), rank);
  const std::size_t after = rest_is_row ? rank : axis + 1;
  const std::size_t outer = elements_between(in.shape, 0, axis);
  const std::size_t length = elements_between(in.shape, axis, after);
  const std::size_t inner = elements_between(in.shape, after, rank);
  float* row = builder.allocate(length);
  Value& out = builder.define_floats(node.output(), in.shape);
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, row, outer, length, inner, run]() noexcept {
    for (std::size_t o = 0; o < outer; ++o) {
      for (std::size_t i = 0; i < inner; ++i) {
        const std::size_t first = o * length * inner + i;
        for (std::size_t k = 0; k < length; ++k) row[k] = from[first + k * inner];
        run(row, length);
        for (std::size_t k = 0; k < length; ++k) to[first + k * inner] = row[k];
      }
    }
  });
}

}  // namespace

void build_softmax(Builder& builder, const Node& node) {
  build_rows(builder, node, softmax_row);
}

void build_log_softmax(Builder& builder, const Node& node) {
  build_rows(builder, node, log_softmax_row);
}

void build_hardmax(Builder& builder, const Node& node) {
  build_rows(builder, node, hardmax_row);
}

void build_layer_normalization(Builder& builder, const Node& node) {
  const Value& in = node.float_input(0);
  const Value& scale = node.float_input(1);
  const Value* bias = node.has_input(2) ? &node.float_input(2) : nullptr;
  if (node.has_output(1) || node.has_output(2)) node.beyond("its mean and deviation as outputs are not supported");
  const std::size_t rank = in.shape.size();
  const std::size_t axis = node.axis(node.integer("axis", -1), rank);
  const std::size_t rows = elements_between(in.shape, 0, axis);
  const std::size_t length = elements_between(in.shape, axis, rank);
  for (const Value* factor : {&scale, bias}) {
    if (factor != nullptr && elements(factor->shape) != length) {
      node.beyond(fmt::format("scale or bias of shape {} does not fit rows of {}", to_text(factor->shape), length));
    }
  }
  Value& out = builder.define_floats(node.output(), in.shape);
  std::vector<const Value*> sources{&in, &scale};
  if (bias != nullptr) sources.push_back(bias);
  builder.compute(out, sources,
                  [from = in.floats, to = out.floats, gain = scale.floats, offset = bias ? bias->floats : nullptr, rows,
                   length, epsilon = node.number("epsilon", 1e-5F)]() noexcept {
                    for (std::size_t r = 0; r < rows; ++r) {
                      float* row = to + r * length;
                      normalise_row(from + r * length, row, length, epsilon);
                      for (std::size_t i = 0; i < length; ++i) row[i] *= gain[i];
                      for (std::size_t i = 0; offset != nullptr && i < length; ++i) row[i] += offset[i];
                    }
                  });
}

void build_batch_normalization(Builder& builder, const Node& node) {
  const Value& in = node.float_input(0);
  if (in.shape.size() < 2) node.refuse("its input has no channels");
  if (node.integer("training_mode", 0) != 0 || node.has_output(1)) node.beyond("training is not supported");
  if (node.integer("spatial", 1) != 1) node.beyond("statistics for each element (spatial 0) are not supported");
  const std::size_t channels = elements_between(in.shape, 1, 2);
  const std::array<const Value*, 4> parameters{&node.float_input(1), &node.float_input(2), &node.float_input(3),
                                               &node.float_input(4)};
  for (const Value* parameter : parameters) {
    if (!parameter->constant || elements(parameter->shape) != channels) {
      node.beyond("scale, bias, mean and variance must be constants, one number per channel");
    }
  }
  const auto [scale, bias, mean, variance] = parameters;
  const float epsilon = node.number("epsilon", 1e-5F);
  float* gain = builder.allocate(channels);
  float* offset = builder.allocate(channels);
  for (std::size_t c = 0; c < channels; ++c) {
    gain[c] = scale->floats[c] / std::sqrt(variance->floats[c] + epsilon);
    offset[c] = bias->floats[c] - mean->floats[c] * gain[c];
  }
  const std::size_t rows = elements_between(in.shape, 0, 2);
  const std::size_t length = elements_between(in.shape, 2, in.shape.size());
  Value& out = builder.define_floats(node.output(), in.shape);
  builder.compute(out, {&in}, [from = in.floats, to = out.floats, gain, offset, rows, channels, length]() noexcept {
    for (std::size_t r = 0; r < rows; ++r) {
      const std::size_t c = r % channels;
      for (std::size_t i = r * length; i < (r + 1) * length; ++i) to[i] = from[i] * gain[c] + offset[c];
    }
  });
}

// Of each channel of each batch by itself.
void build_instance_normalization(Builder& builder, const Node& node) {
  const Value &in = node.float_input(0), &scale = node.float_input(1), &bias = node.float_input(2);
  if (in.shape.size() < 3) node.refuse("its input has no spatial dimensions");
  const std::size_t channels = elements_between(in.shape, 1, 2);
  for (const Value* factor : {&scale, &bias})
    if (elements(factor->shape) != channels)
      node.refuse(fmt::format("scale or bias of shape {} does not fit {} channels", to_text(factor->shape), channels));
  Value& out = builder.define_floats(node.output(), in.shape);
  builder.compute(out, {&in, &scale, &bias},
                  [from = in.floats, to = out.floats, gain = scale.floats, offset = bias.floats, channels,
                   planes = elements_between(in.shape, 0, 2), length = elements_between(in.shape, 2, in.shape.size()),
                   epsilon = node.number("epsilon", 1e-5F)]() noexcept {
                    for (std::size_t p = 0; p < planes; ++p) {
                      float* const plane = to + p * length;
                      normalise_row(from + p * length, plane, length, epsilon);
                      for (std::size_t i = 0; i < length; ++i)
                        plane[i] = plane[i] * gain[p % channels] + offset[p % channels];
                    }
                  });
}

}  // namespace takt::onnx_engine
