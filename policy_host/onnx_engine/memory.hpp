// SPDX-License-Identifier: Apache-2.0
// What recurrent nodes of a graph forget between runs, told without compiling it: for files that another engine runs.
#pragma once

#include "policy_host/onnx_engine/model.hpp"

namespace onnx {
class ModelProto;
}

namespace takt::onnx_engine {

// Of LSTM, GRU and RNN nodes whose start state no input decides: those of one step have lost their memory, those of
// several read a history. How many steps there are is libonnx's to infer, which need not know every operator.
Memory memory_of(onnx::ModelProto model);

}  // namespace takt::onnx_engine
