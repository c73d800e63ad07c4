// SPDX-License-Identifier: Apache-2.0
// Small networks of the demo arm's shapes, obs [1,24] to actions [1,96], that engines take differently.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::policy_host {

inline std::vector<float> some_weights(std::size_t count) {
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = 0.01F * static_cast<float>(i % 7) - 0.03F;
  return values;
}

inline onnx_engine::GraphMaker demo_arm_network() {
  onnx_engine::GraphMaker maker(14);
  maker.input("obs", {1, 24}).output("actions");
  auto& shape = *maker.graph().mutable_output(0)->mutable_type()->mutable_tensor_type()->mutable_shape();
  for (const std::int64_t size : {1, 96}) shape.add_dim()->set_dim_value(size);
  return maker;
}

// LpNormalization, which the built-in engine does not know: actions = LpNormalization(obs w).
inline onnx_engine::GraphMaker beyond_the_built_in_engine() {
  auto maker = demo_arm_network();
  maker.floats("w", {24, 96}, some_weights(24 * 96));
  maker.node("MatMul", {"obs", "w"}, {"h"});
  maker.node("LpNormalization", {"h"}, {"actions"});
  return maker;
}

// A recurrent network exported without its state. `width`: of what follows the memory; from 512 on ONNX Runtime is the
// quicker engine.
inline onnx_engine::GraphMaker forgetful(std::int64_t width) {
  const auto count = static_cast<std::size_t>(width);
  auto maker = demo_arm_network();
  maker.integers("one", {3}, {1, 1, 24}).integers("rows", {2}, {4, 6}).integers("flat", {2}, {1, 96});
  maker.floats("w", {1, 96, 24}, some_weights(std::size_t{96} * 24));
  maker.floats("r", {1, 96, 24}, some_weights(std::size_t{96} * 24));
  maker.floats("a", {6, width}, some_weights(6 * count));
  maker.floats("b", {width, width}, some_weights(count * count)).floats("c", {width, 24}, some_weights(count * 24));
  maker.node("Reshape", {"obs", "one"}, {"x"});
  maker.node("LSTM", {"x", "w", "r"}, {"y"}).with("hidden_size", std::int64_t{24});
  maker.node("Reshape", {"y", "rows"}, {"h"});
  maker.node("MatMul", {"h", "a"}, {"ha"});
  maker.node("MatMul", {"ha", "b"}, {"hb"});
  maker.node("MatMul", {"hb", "c"}, {"hc"});
  maker.node("Reshape", {"hc", "flat"}, {"actions"});
  for (onnx::NodeProto& node : *maker.graph().mutable_node())
    if (node.op_type() != "LSTM") node.set_name("to_" + node.output(0));  // ONNX Runtime wants each name once
  return maker;
}

inline void keep_outside(onnx::TensorProto& tensor, const std::string& location, const std::string& file) {
  std::ofstream data(file, std::ios::binary);
  for (const float value : tensor.float_data()) data.write(reinterpret_cast<const char*>(&value), sizeof value);
  tensor.clear_float_data();
  tensor.set_data_location(onnx::TensorProto_DataLocation_EXTERNAL);
  auto& entry = *tensor.add_external_data();
  entry.set_key("location");
  entry.set_value(location);
}

inline void write(const onnx_engine::GraphMaker& maker, const std::string& file) {
  std::ofstream(file, std::ios::binary) << maker.model.SerializeAsString();
}

}  // namespace takt::policy_host
