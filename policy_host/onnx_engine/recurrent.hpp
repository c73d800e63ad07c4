// SPDX-License-Identifier: Apache-2.0
// What LSTM and GRU share: sizes, packed weights, the input's product for the whole sequence, and the walk through
// time.
//
// Layout 0: input [sequence, batch, input], states [directions, batch, hidden], output [sequence, directions, batch,
// hidden]. Weights are constants. Custom activations, clipping, peepholes and sequence lengths are refused.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/node.hpp"

namespace takt::onnx_engine {

// A constant weight matrix ready for multiply_panels.
struct PackedWeights {
  const float* panels;
  std::size_t inner;
  std::size_t columns;
};

class RecurrentShape {
 public:
  // `gates`: matrices stacked in each weight, 4 for LSTM, 3 for GRU. `activations`: the only ones accepted, per
  // direction.
  RecurrentShape(const Node& node, std::size_t gates, const std::vector<std::string>& activations);

  std::size_t sequence;
  std::size_t batch;
  std::size_t input;
  std::size_t hidden;
  std::size_t directions;

  std::size_t state_size() const { return batch * hidden; }  // of one direction
  bool runs_backward(std::size_t direction) const { return backward_only_ || direction == 1; }
  // Which element of the sequence a direction sees at its `step`-th step.
  std::size_t time(std::size_t direction, std::size_t step) const {
    return runs_backward(direction) ? sequence - 1 - step : step;
  }

 private:
  bool backward_only_;
};

// `count` gates of input `index` (W or R), from gate `first` on, of one direction.
PackedWeights pack_gates(Builder& builder, const Node& node, std::size_t index, const RecurrentShape& shape,
                         std::size_t gates, std::size_t direction, std::size_t first, std::size_t count);

// Both halves of B for one direction, `gates` times hidden each: of the input, then of the state. Zeros without a B.
struct Biases {
  const float* input;
  const float* state;
};
Biases gate_biases(Builder& builder, const Node& node, const RecurrentShape& shape, std::size_t gates,
                   std::size_t direction);

// Tells the builder of a network that steps once a run and begins each run anew.
void note_lost_state(Builder& builder, const Node& node, const RecurrentShape& shape);

// A state [directions, batch, hidden] defined as output `output`, set from input `input` (or zero) at the start of a
// run.
float* define_state(Builder& builder, const Node& node, std::size_t input, std::size_t output,
                    const RecurrentShape& shape);

// Output 0: every state along the way.
float* define_sequence_output(Builder& builder, const Node& node, const RecurrentShape& shape);

}  // namespace takt::onnx_engine
