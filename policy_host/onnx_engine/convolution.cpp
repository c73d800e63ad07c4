// SPDX-License-Identifier: Apache-2.0
// Conv over one to three dimensions: the input's patches, gathered as the panels of a right-hand matrix, times the
// kernels.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/panels.hpp"
#include "policy_host/onnx_engine/window.hpp"

namespace takt::onnx_engine {

namespace {

// Columns that are gathered of the panel from `first` on: of one that is hardly used only the part that a slice of
// multiply_panels() reads.
std::size_t gathered_columns(std::size_t first, std::size_t columns) noexcept {
  constexpr std::size_t half = panel_columns / 2;
  return columns - first > half ? panel_columns : half;
}

// For each gathered element of the packed patches of one group, in the order of pack_panels: where in the group's
// planes it is; padding is behind them, where a zero is.
std::vector<std::uint32_t> patch_table(const Window& window, std::size_t channels) {
  const std::size_t inner = channels * window.kernel_size();
  const std::size_t columns = window.output_size();
  const auto padding = static_cast<std::uint32_t>(channels * window.input_size());
  std::vector<std::uint32_t> table;
  table.reserve(packed_size(inner, columns));
  for (std::size_t first = 0; first < columns; first += panel_columns) {
    for (std::size_t k = 0; k < inner; ++k) {
      const std::size_t plane = k / window.kernel_size() * window.input_size();
      for (std::size_t position = first; position < first + gathered_columns(first, columns); ++position) {
        const std::int64_t source = position < columns ? window.source(position, k % window.kernel_size()) : -1;
        table.push_back(source < 0 ? padding : static_cast<std::uint32_t>(plane + static_cast<std::size_t>(source)));
      }
    }
  }
  return table;
}

struct Convolution {
  std::vector<std::uint32_t> table;
  std::size_t batch, groups;
  std::size_t group_input;  // elements of one group's planes
  std::size_t kernels;      // of one group
  std::size_t inner, columns;
  const float* from;
  const float* weights;
  const float* bias;  // one per kernel, or null
  float* planes;      // of one group, and a zero
  float* patches;
  float* to;

  void gather() const noexcept {
    const float* const source = planes;
    const std::uint32_t* index = table.data();
    float* patch = patches;
    for (std::size_t first = 0; first < columns; first += panel_columns) {
      const std::size_t gathered = gathered_columns(first, columns);
      for (std::size_t k = 0; k < inner; ++k, index += gathered, patch += panel_columns)
        for (std::size_t c = 0; c < gathered; ++c) patch[c] = source[index[c]];
    }
  }

  void run() const noexcept {
    float* out = to;
    const float* in = from;
    for (std::size_t b = 0; b < batch; ++b) {
      for (std::size_t g = 0; g < groups; ++g, in += group_input, out += kernels * columns) {
        std::copy_n(in, group_input, planes);
        gather();
        multiply_panels(weights + g * kernels * inner, patches, kernels, inner, columns, out);
        for (std::size_t k = 0; bias != nullptr && k < kernels; ++k) {
          for (std::size_t c = 0; c < columns; ++c) out[k * columns + c] += bias[g * kernels + k];
        }
      }
    }
  }
};

}  // namespace

void build_conv(Builder& builder, const Node& node) {
  const Value& in = node.float_input(0);
  const Value& weight = node.float_input(1);
  const Value* bias = node.has_input(2) ? &node.float_input(2) : nullptr;
  const Shape& w = weight.shape;
  if (w.size() != in.shape.size() || w.size() < 3) {
    node.refuse(fmt::format("kernels of shape {} do not fit an input of shape {}", to_text(w), to_text(in.shape)));
  }
  const Window window = read_window(node, in.shape, Shape(w.begin() + 2, w.end()));
  const std::int64_t groups = node.integer("group", 1);
  if (groups < 1 || groups > in.shape[1] || w[0] % groups != 0 || in.shape[1] % groups != 0 ||
      in.shape[1] / groups != w[1]) {
    node.refuse(fmt::format("kernels of shape {} in {} groups do not fit an input of shape {}", to_text(w), groups,
                            to_text(in.shape)));
  }
  if (bias != nullptr && elements(bias->shape) != static_cast<std::size_t>(w[0])) {
    node.refuse(fmt::format("a bias of shape {} does not fit {} kernels", to_text(bias->shape), w[0]));
  }
  const auto channels = static_cast<std::size_t>(w[1]);
  const std::size_t inner = channels * window.kernel_size();
  Value& out = builder.define_floats(node.output(), window.output_shape(in.shape[0], w[0]));
  if (checked_elements({static_cast<std::int64_t>(inner), static_cast<std::int64_t>(window.output_size())}) < 0) {
    node.beyond("its patches are larger than this engine holds");
  }
  const std::size_t patches = packed_size(inner, window.output_size());
  builder.charge(patches * sizeof(std::uint32_t));
  Convolution convolution{.table = patch_table(window, channels),
                          .batch = static_cast<std::size_t>(in.shape[0]),
                          .groups = static_cast<std::size_t>(groups),
                          .group_input = channels * window.input_size(),
                          .kernels = static_cast<std::size_t>(w[0] / groups),
                          .inner = inner,
                          .columns = window.output_size(),
                          .from = in.floats,
                          .weights = weight.floats,
                          .bias = bias == nullptr ? nullptr : bias->floats,
                          .planes = builder.allocate(channels * window.input_size() + 1),
                          .patches = builder.allocate(patches),
                          .to = out.floats};
  builder.count_matrix_work(static_cast<std::size_t>(in.shape[0] * w[0]), inner, window.output_size());
  std::vector<const Value*> sources{&in, &weight};
  if (bias != nullptr) sources.push_back(bias);
  builder.compute(out, sources, [convolution = std::move(convolution)]() noexcept { convolution.run(); });
}

}  // namespace takt::onnx_engine
