// SPDX-License-Identifier: Apache-2.0
// GRU: gates z and r through the logistic function, candidate n through tanh; H' = (1 - z) n + z H.
// The reset gate acts on the state before its product with the weights, or after it (linear_before_reset, PyTorch's
// way).
#include <algorithm>

#include "policy_host/onnx_engine/lanes.hpp"
#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/panels.hpp"
#include "policy_host/onnx_engine/recurrent.hpp"

namespace takt::onnx_engine {

namespace {

constexpr std::size_t kGruGates = 3;

struct GruDirection {
  RecurrentShape shape;
  std::size_t index;
  bool reset_after;  // linear_before_reset
  PackedWeights from_input;
  PackedWeights zr_from_state;
  PackedWeights n_from_state;
  Biases bias;
  const float* x;
  float* input_part;  // [sequence, batch, 3 hidden]: the input's share of the gates
  float* zr;          // [batch, 2 hidden]
  float* reset;       // [batch, hidden]: the state after the reset gate
  float* n;           // [batch, hidden]
  float* h;           // [batch, hidden]
  float* y;           // [sequence, directions, batch, hidden]
};

// Both gates of one row; `zr` holds the state's share on entry.
void gate_row(const GruDirection& d, const float* input_part, float* zr) noexcept {
  const std::size_t width = 2 * d.shape.hidden;
  for (std::size_t i = 0; i < width; ++i) {
    zr[i] = (input_part[i] + d.bias.input[i]) + (zr[i] + d.bias.state[i]);
  }
  map_lanes(zr, zr, width, [](const Lane& x) noexcept { return lane_sigmoid(x); });
}

// The candidate and the new state of one row; `n` holds the state's share on entry.
void state_row(const GruDirection& d, const float* input_part, const float* zr, float* n, float* h) noexcept {
  const std::size_t hidden = d.shape.hidden;
  const float* from_input = input_part + 2 * hidden;
  const float* input_bias = d.bias.input + 2 * hidden;
  const float* state_bias = d.bias.state + 2 * hidden;
  for (std::size_t i = 0; i < hidden; ++i) {
    const float from_state = n[i] + state_bias[i];
    n[i] = (from_input[i] + input_bias[i]) + (d.reset_after ? zr[hidden + i] * from_state : from_state);
  }
  map_lanes(n, n, hidden, [](const Lane& x) noexcept { return lane_tanh(x); });
  for (std::size_t i = 0; i < hidden; ++i) h[i] = (1.0F - zr[i]) * n[i] + zr[i] * h[i];
}

void run_gru_step(const GruDirection& d, std::size_t t) noexcept {
  const RecurrentShape& s = d.shape;
  const float* input_part = d.input_part + t * s.batch * kGruGates * s.hidden;
  multiply_panels(d.h, d.zr_from_state.panels, s.batch, s.hidden, 2 * s.hidden, d.zr);
  for (std::size_t b = 0; b < s.batch; ++b) gate_row(d, input_part + b * kGruGates * s.hidden, d.zr + b * 2 * s.hidden);

  const float* state = d.h;
  if (!d.reset_after) {
    for (std::size_t i = 0; i < s.state_size(); ++i) {
      const std::size_t b = i / s.hidden;
      d.reset[i] = d.zr[(2 * b + 1) * s.hidden + i % s.hidden] * d.h[i];
    }
    state = d.reset;
  }
  multiply_panels(state, d.n_from_state.panels, s.batch, s.hidden, s.hidden, d.n);
  for (std::size_t b = 0; b < s.batch; ++b) {
    state_row(d, input_part + b * kGruGates * s.hidden, d.zr + b * 2 * s.hidden, d.n + b * s.hidden,
              d.h + b * s.hidden);
  }
}

void run_gru(const GruDirection& d) noexcept {
  const RecurrentShape& s = d.shape;
  multiply_panels(d.x, d.from_input.panels, s.sequence * s.batch, s.input, kGruGates * s.hidden, d.input_part);
  for (std::size_t step = 0; step < s.sequence; ++step) {
    const std::size_t t = s.time(d.index, step);
    run_gru_step(d, t);
    std::copy_n(d.h, s.state_size(), d.y + (t * s.directions + d.index) * s.state_size());
  }
}

}  // namespace

void build_gru(Builder& builder, const Node& node) {
  const RecurrentShape shape(node, kGruGates, {"Sigmoid", "Tanh"});
  note_lost_state(builder, node, shape);
  float* y = define_sequence_output(builder, node, shape);
  float* h = define_state(builder, node, 5, 1, shape);
  float* input_part = builder.allocate(shape.sequence * shape.batch * kGruGates * shape.hidden);
  float* zr = builder.allocate(2 * shape.state_size());
  float* reset = builder.allocate(shape.state_size());
  float* n = builder.allocate(shape.state_size());
  for (std::size_t i = 0; i < shape.directions; ++i) {
    const GruDirection direction{.shape = shape,
                                 .index = i,
                                 .reset_after = node.integer("linear_before_reset", 0) != 0,
                                 .from_input = pack_gates(builder, node, 1, shape, kGruGates, i, 0, kGruGates),
                                 .zr_from_state = pack_gates(builder, node, 2, shape, kGruGates, i, 0, 2),
                                 .n_from_state = pack_gates(builder, node, 2, shape, kGruGates, i, 2, 1),
                                 .bias = gate_biases(builder, node, shape, kGruGates, i),
                                 .x = node.float_input(0).floats,
                                 .input_part = input_part,
                                 .zr = zr,
                                 .reset = reset,
                                 .n = n,
                                 .h = h + i * shape.state_size(),
                                 .y = y};
    builder.each_run([direction]() noexcept { run_gru(direction); });
  }
}

}  // namespace takt::onnx_engine
