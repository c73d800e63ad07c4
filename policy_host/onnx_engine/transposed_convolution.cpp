// SPDX-License-Identifier: Apache-2.0
// ConvTranspose over one or two dimensions: every element of the input adds its kernel to the result.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/rearrange.hpp"

namespace takt::onnx_engine {

namespace {

// One spatial dimension.
struct Axis {
  std::int64_t input = 1, output = 1, kernel = 1, stride = 1, dilation = 1, pad_before = 0;
};

using Axes = std::array<Axis, 2>;  // rows, then columns; an input with one spatial dimension has one row

std::vector<std::int64_t> numbers(const Node& node, std::string_view name, std::size_t count, std::int64_t otherwise,
                                  std::int64_t least) {
  constexpr std::int64_t most = 1 << 20;
  std::vector<std::int64_t> given = node.integers(name).value_or(std::vector<std::int64_t>(count, otherwise));
  if (given.size() != count) node.refuse(fmt::format("{} must have {} numbers", name, count));
  for (const std::int64_t number : given)
    if (number < least || number > most) node.refuse(fmt::format("{} of {} is not supported", name, number));
  return given;
}

Axes read_axes(const Node& node, const Shape& input, const Shape& weight) {
  const std::size_t rank = input.size() - 2;
  const std::string automatic = node.text("auto_pad", "NOTSET");
  const bool same = automatic == "SAME_UPPER" || automatic == "SAME_LOWER";
  if (!same && automatic != "NOTSET" && automatic != "VALID")
    node.beyond(fmt::format("auto_pad '{}' is not supported", automatic));
  const auto kernel = node.integers("kernel_shape").value_or(Shape(weight.begin() + 2, weight.end()));
  if (!std::ranges::equal(kernel, std::span(weight).subspan(2))) node.refuse("kernel_shape does not fit its weights");
  const auto strides = numbers(node, "strides", rank, 1, 1), dilations = numbers(node, "dilations", rank, 1, 1);
  const auto pads = numbers(node, "pads", 2 * rank, 0, 0), more = numbers(node, "output_padding", rank, 0, 0);
  const auto wanted = node.integers("output_shape");
  if (wanted && wanted->size() != rank) node.refuse("output_shape does not fit its input");
  Axes axes;
  for (std::size_t d = 0; d < rank; ++d) {
    Axis& axis = axes[2 - rank + d];
    axis = {.input = input[2 + d], .kernel = kernel[d], .stride = strides[d], .dilation = dilations[d]};
    const std::int64_t full = (axis.input - 1) * axis.stride + more[d] + (axis.kernel - 1) * axis.dilation + 1;
    std::int64_t cut = automatic == "NOTSET" ? pads[d] + pads[rank + d] : 0;
    axis.pad_before = automatic == "NOTSET" ? pads[d] : 0;
    if (wanted || same) {  // what is too much goes from both ends
      cut = full - (wanted ? (*wanted)[d] : axis.input * axis.stride);
      axis.pad_before = automatic == "SAME_UPPER" ? cut / 2 : cut - cut / 2;
    }
    axis.output = full - cut;
    if (axis.output < 1 || axis.output > full || cut < 0)
      node.beyond(fmt::format("an output of {} from {} is not supported", axis.output, axis.input));
  }
  return axes;
}

// Where the element at `position` of the input's plane and `k` of the kernel add to; -1: beside the result.
std::int64_t target(const Axes& axes, std::int64_t position, std::int64_t k) {
  const auto [rows, columns] = axes;
  const std::int64_t row =
      (position / columns.input) * rows.stride + (k / columns.kernel) * rows.dilation - rows.pad_before;
  const std::int64_t column =
      (position % columns.input) * columns.stride + (k % columns.kernel) * columns.dilation - columns.pad_before;
  if (row < 0 || row >= rows.output || column < 0 || column >= columns.output) return -1;
  return row * columns.output + column;
}

struct Landing {
  std::uint32_t position, k, target;
};

struct Transposed {
  std::vector<Landing> landings;
  std::size_t batch, groups, inputs, outputs;  // channels of one group
  std::size_t plane, kernel, result;           // elements of an input's plane, a kernel and a result's plane
  const float* from;
  const float* weights;  // [input channel][output channel of the group][kernel]
  const float* bias;     // one per output channel, or null
  float* to;

  void run() const noexcept {
    for (std::size_t b = 0; b < batch; ++b)
      for (std::size_t g = 0; g < groups; ++g)
        for (std::size_t o = 0; o < outputs; ++o) {
          const std::size_t channel = g * outputs + o;
          float* const out = to + (b * groups * outputs + channel) * result;
          std::fill_n(out, result, 0.0F);
          for (std::size_t i = 0; i < inputs; ++i) {
            const float* const in = from + (b * groups * inputs + g * inputs + i) * plane;
            const float* const weight = weights + ((g * inputs + i) * outputs + o) * kernel;
            for (const Landing& landing : landings) out[landing.target] += in[landing.position] * weight[landing.k];
          }
          for (std::size_t r = 0; bias != nullptr && r < result; ++r) out[r] += bias[channel];
        }
  }
};

std::vector<Landing> landings_of(const Axes& axes) {
  std::vector<Landing> landings;
  for (std::int64_t position = 0; position < axes[0].input * axes[1].input; ++position)
    for (std::int64_t k = 0; k < axes[0].kernel * axes[1].kernel; ++k)
      if (const std::int64_t place = target(axes, position, k); place >= 0)
        landings.push_back(
            {static_cast<std::uint32_t>(position), static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(place)});
  return landings;
}

}  // namespace

void build_conv_transpose(Builder& builder, const Node& node) {
  const Value &in = node.float_input(0), &weight = node.float_input(1);
  const Value* const bias = node.has_input(2) ? &node.float_input(2) : nullptr;
  if (in.shape.size() != 3 && in.shape.size() != 4)
    node.beyond(fmt::format("an input of shape {} has not one or two spatial dimensions", to_text(in.shape)));
  const std::int64_t groups = node.integer("group", 1);
  if (weight.shape.size() != in.shape.size() || weight.shape[0] != in.shape[1] || groups < 1 || groups > in.shape[1] ||
      in.shape[1] % groups != 0)
    node.refuse(fmt::format("kernels of shape {} in {} groups do not fit an input of shape {}", to_text(weight.shape),
                            groups, to_text(in.shape)));
  const Axes axes = read_axes(node, in.shape, weight.shape);
  const std::int64_t channels = weight.shape[1] * groups;
  if (bias != nullptr && elements(bias->shape) != static_cast<std::size_t>(channels))
    node.refuse(fmt::format("a bias of shape {} does not fit {} kernels", to_text(bias->shape), channels));
  Shape shape{in.shape[0], channels};
  for (std::size_t d = 4 - in.shape.size(); d < 2; ++d) shape.push_back(axes[d].output);
  const std::int64_t plane = axes[0].input * axes[1].input, kernel = axes[0].kernel * axes[1].kernel;
  charge_table(builder, node, {plane, kernel, 3});
  Value& out = builder.define_floats(node.output(), shape);
  builder.count_matrix_work(static_cast<std::size_t>(in.shape[0] * channels),
                            static_cast<std::size_t>(weight.shape[0] / groups),
                            static_cast<std::size_t>(plane * kernel));
  Transposed work{.landings = landings_of(axes),
                  .batch = static_cast<std::size_t>(in.shape[0]),
                  .groups = static_cast<std::size_t>(groups),
                  .inputs = static_cast<std::size_t>(in.shape[1] / groups),
                  .outputs = static_cast<std::size_t>(weight.shape[1]),
                  .plane = static_cast<std::size_t>(plane),
                  .kernel = static_cast<std::size_t>(kernel),
                  .result = static_cast<std::size_t>(axes[0].output * axes[1].output),
                  .from = in.floats,
                  .weights = weight.floats,
                  .bias = bias == nullptr ? nullptr : bias->floats,
                  .to = out.floats};
  std::vector<const Value*> sources{&in, &weight};
  if (bias != nullptr) sources.push_back(bias);
  builder.compute(out, sources, [work = std::move(work)]() noexcept { work.run(); });
}

}  // namespace takt::onnx_engine
