// SPDX-License-Identifier: Apache-2.0
// LSTM: gates i, o, f through the logistic function, the candidate c through tanh; C' = f C + i c, H' = o tanh(C').
#include <algorithm>

#include "policy_host/onnx_engine/lanes.hpp"
#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/panels.hpp"
#include "policy_host/onnx_engine/recurrent.hpp"

namespace takt::onnx_engine {

namespace {

constexpr std::size_t kLstmGates = 4;

struct LstmDirection {
  RecurrentShape shape;
  std::size_t index;
  PackedWeights from_input;
  PackedWeights from_state;
  Biases bias;
  const float* x;
  float* input_part;  // [sequence, batch, 4 hidden]: the input's share of the gates
  float* gate;        // [batch, 4 hidden]
  float* h;           // [batch, hidden]
  float* c;
  float* y;  // [sequence, directions, batch, hidden]
};

// `gate` holds the state's share on entry; order i, o, f, c.
void step_row(const LstmDirection& d, const float* input_part, float* gate, float* h, float* c) noexcept {
  const std::size_t n = d.shape.hidden;
  for (std::size_t i = 0; i < kLstmGates * n; ++i) {
    gate[i] = (input_part[i] + d.bias.input[i]) + (gate[i] + d.bias.state[i]);
  }
  map_lanes(gate, gate, 3 * n, [](const Lane& x) noexcept { return lane_sigmoid(x); });
  map_lanes(gate + 3 * n, gate + 3 * n, n, [](const Lane& x) noexcept { return lane_tanh(x); });
  for (std::size_t i = 0; i < n; ++i) c[i] = gate[2 * n + i] * c[i] + gate[i] * gate[3 * n + i];
  map_lanes(c, h, n, [](const Lane& x) noexcept { return lane_tanh(x); });
  for (std::size_t i = 0; i < n; ++i) h[i] *= gate[n + i];
}

void run_lstm(const LstmDirection& d) noexcept {
  const RecurrentShape& s = d.shape;
  const std::size_t width = kLstmGates * s.hidden;
  multiply_panels(d.x, d.from_input.panels, s.sequence * s.batch, s.input, width, d.input_part);
  for (std::size_t step = 0; step < s.sequence; ++step) {
    const std::size_t t = s.time(d.index, step);
    multiply_panels(d.h, d.from_state.panels, s.batch, s.hidden, width, d.gate);
    for (std::size_t b = 0; b < s.batch; ++b) {
      step_row(d, d.input_part + (t * s.batch + b) * width, d.gate + b * width, d.h + b * s.hidden, d.c + b * s.hidden);
    }
    std::copy_n(d.h, s.state_size(), d.y + (t * s.directions + d.index) * s.state_size());
  }
}

}  // namespace

void build_lstm(Builder& builder, const Node& node) {
  const RecurrentShape shape(node, kLstmGates, {"Sigmoid", "Tanh", "Tanh"});
  note_lost_state(builder, node, shape);
  float* y = define_sequence_output(builder, node, shape);
  float* h = define_state(builder, node, 5, 1, shape);
  float* c = define_state(builder, node, 6, 2, shape);
  float* input_part = builder.allocate(shape.sequence * shape.batch * kLstmGates * shape.hidden);
  float* gate = builder.allocate(shape.batch * kLstmGates * shape.hidden);
  for (std::size_t i = 0; i < shape.directions; ++i) {
    const LstmDirection direction{.shape = shape,
                                  .index = i,
                                  .from_input = pack_gates(builder, node, 1, shape, kLstmGates, i, 0, kLstmGates),
                                  .from_state = pack_gates(builder, node, 2, shape, kLstmGates, i, 0, kLstmGates),
                                  .bias = gate_biases(builder, node, shape, kLstmGates, i),
                                  .x = node.float_input(0).floats,
                                  .input_part = input_part,
                                  .gate = gate,
                                  .h = h + i * shape.state_size(),
                                  .c = c + i * shape.state_size(),
                                  .y = y};
    builder.each_run([direction]() noexcept { run_lstm(direction); });
  }
}

}  // namespace takt::onnx_engine
