// SPDX-License-Identifier: Apache-2.0
// Builds small ONNX models in memory, so that the engine's tests need neither files nor Python.
#pragma once

#include <gtest/gtest.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <vector>

#include "policy_host/onnx_engine/model.hpp"

namespace takt::onnx_engine {

using Dims = std::vector<std::int64_t>;

class NodeMaker {
 public:
  explicit NodeMaker(onnx::NodeProto& proto) : proto_(proto) {}

  NodeMaker& with(const std::string& name, std::int64_t value) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_INT);
    attribute.set_i(value);
    return *this;
  }
  NodeMaker& with(const std::string& name, float value) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_FLOAT);
    attribute.set_f(value);
    return *this;
  }
  NodeMaker& with(const std::string& name, const std::string& value) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_STRING);
    attribute.set_s(value);
    return *this;
  }
  NodeMaker& with(const std::string& name, const Dims& values) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_INTS);
    for (const std::int64_t value : values) attribute.add_ints(value);
    return *this;
  }
  NodeMaker& with(const std::string& name, const std::vector<float>& values) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_FLOATS);
    for (const float value : values) attribute.add_floats(value);
    return *this;
  }
  NodeMaker& with(const std::string& name, const std::vector<std::string>& values) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_STRINGS);
    for (const std::string& value : values) attribute.add_strings(value);
    return *this;
  }
  NodeMaker& with(const std::string& name, const onnx::TensorProto& value) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_TENSOR);
    *attribute.mutable_t() = value;
    return *this;
  }
  NodeMaker& with(const std::string& name, const onnx::GraphProto& value) {
    onnx::AttributeProto& attribute = add(name, onnx::AttributeProto_AttributeType_GRAPH);
    *attribute.mutable_g() = value;
    return *this;
  }

 private:
  onnx::AttributeProto& add(const std::string& name, onnx::AttributeProto_AttributeType type) {
    onnx::AttributeProto& attribute = *proto_.add_attribute();
    attribute.set_name(name);
    attribute.set_type(type);
    return attribute;
  }

  onnx::NodeProto& proto_;
};

inline onnx::TensorProto float_tensor(const std::string& name, const Dims& dims, const std::vector<float>& values) {
  onnx::TensorProto tensor;
  tensor.set_name(name);
  tensor.set_data_type(onnx::TensorProto_DataType_FLOAT);
  for (const std::int64_t dim : dims) tensor.add_dims(dim);
  for (const float value : values) tensor.add_float_data(value);
  return tensor;
}

inline onnx::TensorProto integer_tensor(const std::string& name, const Dims& dims, const Dims& values) {
  onnx::TensorProto tensor;
  tensor.set_name(name);
  tensor.set_data_type(onnx::TensorProto_DataType_INT64);
  for (const std::int64_t dim : dims) tensor.add_dims(dim);
  for (const std::int64_t value : values) tensor.add_int64_data(value);
  return tensor;
}

class GraphMaker {
 public:
  explicit GraphMaker(std::int64_t opset = 13) {
    model.set_ir_version(7);
    model.add_opset_import()->set_version(opset);
    graph().set_name("test");
  }

  onnx::GraphProto& graph() { return *model.mutable_graph(); }

  GraphMaker& input(const std::string& name, const Dims& dims) { return value(*graph().add_input(), name, &dims); }
  GraphMaker& output(const std::string& name) { return value(*graph().add_output(), name, nullptr); }
  GraphMaker& floats(const std::string& name, const Dims& dims, const std::vector<float>& values) {
    *graph().add_initializer() = float_tensor(name, dims, values);
    return *this;
  }
  GraphMaker& integers(const std::string& name, const Dims& dims, const Dims& values) {
    *graph().add_initializer() = integer_tensor(name, dims, values);
    return *this;
  }
  NodeMaker node(const std::string& op, const std::vector<std::string>& inputs,
                 const std::vector<std::string>& outputs) {
    onnx::NodeProto& proto = *graph().add_node();
    proto.set_op_type(op);
    proto.set_name("the_" + op);
    for (const std::string& in : inputs) proto.add_input(in);
    for (const std::string& out : outputs) proto.add_output(out);
    return NodeMaker(proto);
  }

  std::expected<Model, std::string> load() const {
    const std::string bytes = model.SerializeAsString();
    return onnx_engine::load(std::as_bytes(std::span(bytes)), "model");
  }
  // The sentence with which the model is refused; "" if it is not.
  std::string refusal() const {
    const auto loaded = load();
    return loaded ? std::string() : loaded.error();
  }

  onnx::ModelProto model;

 private:
  GraphMaker& value(onnx::ValueInfoProto& info, const std::string& name, const Dims* dims) {
    info.set_name(name);
    auto& tensor = *info.mutable_type()->mutable_tensor_type();
    tensor.set_elem_type(onnx::TensorProto_DataType_FLOAT);
    auto& shape = *tensor.mutable_shape();
    if (dims == nullptr) return *this;  // no dimensions: the engine finds out
    for (const std::int64_t dim : *dims) shape.add_dim()->set_dim_value(dim);
    return *this;
  }
};

struct Result {
  Dims shape;
  std::vector<float> values;
  bool operator==(const Result&) const = default;
};

// Loads the model, writes the inputs, runs it twice (a second run must not see traces of the first) and returns output
// `i`.
inline Result evaluate(const GraphMaker& maker, const std::vector<std::vector<float>>& inputs, std::size_t i = 0) {
  auto model = maker.load();
  if (!model) {
    ADD_FAILURE() << model.error();
    return {};
  }
  EXPECT_EQ(model->inputs().size(), inputs.size());
  for (std::size_t in = 0; in < inputs.size(); ++in) {
    EXPECT_EQ(model->input(in).size(), inputs[in].size());
    std::ranges::copy(inputs[in], model->input(in).begin());
  }
  model->run();
  model->run();
  const std::span<const float> out = model->output(i);
  return {model->outputs()[i].shape, {out.begin(), out.end()}};
}

inline void expect_near(const Result& result, const Dims& shape, const std::vector<float>& expected,
                        float tolerance = 1e-6F) {
  EXPECT_EQ(result.shape, shape);
  ASSERT_EQ(result.values.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(result.values[i], expected[i], tolerance) << "at " << i;
}

}  // namespace takt::onnx_engine
