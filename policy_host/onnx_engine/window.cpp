// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/window.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

namespace takt::onnx_engine {

namespace {

// Along each axis.
using Place = std::array<std::int64_t, 3>;

Place place(const Window& window, std::size_t position, std::size_t k) {
  auto p = static_cast<std::int64_t>(position), element = static_cast<std::int64_t>(k);
  Place place{};
  for (std::size_t d = window.axes.size(); d-- > 0;) {
    const WindowAxis& axis = window.axes[d];
    place[d] = (p % axis.output) * axis.stride + (element % axis.kernel) * axis.dilation - axis.pad_before;
    p /= axis.output;
    element /= axis.kernel;
  }
  return place;
}

bool within(std::int64_t at, std::int64_t low, std::int64_t high) {
  return at >= low && at < high;
}

// One number for each spatial dimension (or `per_axis` of them), each at least `least`.
std::vector<std::int64_t> numbers(const Node& node, std::string_view name, std::size_t count, std::int64_t otherwise,
                                  std::int64_t least) {
  constexpr std::int64_t most = 1 << 20;
  const std::vector<std::int64_t> given = node.integers(name).value_or(std::vector<std::int64_t>(count, otherwise));
  if (given.size() != count) node.refuse(fmt::format("{} must have {} numbers", name, count));
  for (const std::int64_t number : given) {
    if (number < least || number > most) node.refuse(fmt::format("{} of {} is not supported", name, number));
  }
  return given;
}

void pad_to_same(WindowAxis& axis, bool more_after) {
  const std::int64_t reach = (axis.kernel - 1) * axis.dilation + 1;
  const std::int64_t wanted = (axis.input + axis.stride - 1) / axis.stride;
  const std::int64_t total = std::max<std::int64_t>(0, (wanted - 1) * axis.stride + reach - axis.input);
  axis.pad_before = more_after ? total / 2 : total - total / 2;
  axis.pad_after = total - axis.pad_before;
}

void settle_output(const Node& node, WindowAxis& axis, bool round_up) {
  const std::int64_t reach = (axis.kernel - 1) * axis.dilation + 1;
  const std::int64_t room = axis.input + axis.pad_before + axis.pad_after - reach;
  if (room < 0) node.refuse(fmt::format("a window of {} does not fit into {}", reach, axis.input));
  axis.output = (room + (round_up ? axis.stride - 1 : 0)) / axis.stride + 1;
}

}  // namespace

std::int64_t Window::source(std::size_t position, std::size_t k) const {
  const Place at = place(*this, position, k);
  std::int64_t source = 0;
  for (std::size_t d = 0; d < axes.size(); ++d) {
    if (!within(at[d], 0, axes[d].input)) return -1;
    source = source * axes[d].input + at[d];
  }
  return source;
}

bool Window::inside_padding(std::size_t position, std::size_t k) const {
  const Place at = place(*this, position, k);
  for (std::size_t d = 0; d < axes.size(); ++d)
    if (!within(at[d], -axes[d].pad_before, axes[d].input + axes[d].pad_after)) return false;
  return true;
}

Shape Window::output_shape(std::int64_t batch, std::int64_t channels) const {
  Shape shape{batch, channels};
  for (std::size_t d = axes.size() - rank; d < axes.size(); ++d) shape.push_back(axes[d].output);
  return shape;
}

Window read_window(const Node& node, const Shape& input, const Shape& kernel) {
  if (input.size() < 3 || input.size() > 5) {
    node.beyond(fmt::format("an input of shape {} has not one to three spatial dimensions", to_text(input)));
  }
  Window window;
  window.rank = input.size() - 2;
  const std::size_t rank = window.rank;
  const Shape sizes = node.integers("kernel_shape").value_or(kernel);
  if (sizes.size() != rank || (!kernel.empty() && sizes != kernel)) node.refuse("kernel_shape does not fit its input");
  const std::vector<std::int64_t> strides = numbers(node, "strides", rank, 1, 1);
  const std::vector<std::int64_t> dilations = numbers(node, "dilations", rank, 1, 1);
  const std::vector<std::int64_t> pads = numbers(node, "pads", 2 * rank, 0, 0);
  const std::string automatic = node.text("auto_pad", "NOTSET");
  const bool same = automatic == "SAME_UPPER" || automatic == "SAME_LOWER";
  if (!same && automatic != "NOTSET" && automatic != "VALID") {
    node.beyond(fmt::format("auto_pad '{}' is not supported", automatic));
  }
  for (std::size_t d = 0; d < rank; ++d) {
    WindowAxis& axis = window.axes[window.axes.size() - rank + d];
    if (sizes[d] < 1 || sizes[d] > (1 << 20)) node.refuse(fmt::format("a kernel of {} is not supported", sizes[d]));
    axis = {.input = input[2 + d],
            .kernel = sizes[d],
            .stride = strides[d],
            .dilation = dilations[d],
            .pad_before = automatic == "NOTSET" ? pads[d] : 0,
            .pad_after = automatic == "NOTSET" ? pads[rank + d] : 0};
    if (same) pad_to_same(axis, automatic == "SAME_UPPER");
    settle_output(node, axis, node.integer("ceil_mode", 0) != 0);
  }
  return window;
}

}  // namespace takt::onnx_engine
