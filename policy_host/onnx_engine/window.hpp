// SPDX-License-Identifier: Apache-2.0
// The window that a convolution or a pooling moves over the last one to three dimensions of [batch, channels,
// ...].
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "policy_host/onnx_engine/node.hpp"
#include "policy_host/onnx_engine/tensor.hpp"

namespace takt::onnx_engine {

// One spatial dimension.
struct WindowAxis {
  std::int64_t input = 1;
  std::int64_t output = 1;
  std::int64_t kernel = 1;
  std::int64_t stride = 1;
  std::int64_t dilation = 1;
  std::int64_t pad_before = 0;
  std::int64_t pad_after = 0;
};

// Layers, rows, columns; an input with fewer spatial dimensions has one layer, and one row.
struct Window {
  std::array<WindowAxis, 3> axes;
  std::size_t rank = 3;  // spatial dimensions of the input

  std::size_t kernel_size() const { return product(&WindowAxis::kernel); }
  std::size_t input_size() const { return product(&WindowAxis::input); }
  std::size_t output_size() const { return product(&WindowAxis::output); }
  // Where in a channel's plane output `position` finds kernel element `k`; -1: in the padding.
  std::int64_t source(std::size_t position, std::size_t k) const;
  // Whether it is inside the padded plane (a window that ceil_mode lets hang over is not).
  bool inside_padding(std::size_t position, std::size_t k) const;
  // [batch, channels, spatial dimensions of the output]
  Shape output_shape(std::int64_t batch, std::int64_t channels) const;

 private:
  std::size_t product(std::int64_t WindowAxis::*size) const {
    return static_cast<std::size_t>(axes[0].*size * axes[1].*size * axes[2].*size);
  }
};

// From the input's shape and the attributes kernel_shape (or `kernel` where the node has none), strides, pads,
// dilations, auto_pad, ceil_mode; refuses what does not fit.
Window read_window(const Node& node, const Shape& input, const Shape& kernel);

}  // namespace takt::onnx_engine
