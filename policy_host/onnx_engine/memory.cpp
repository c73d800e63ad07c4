// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/memory.hpp"

#include <onnx/defs/schema.h>
#include <onnx/onnx_pb.h>
#include <onnx/shape_inference/implementation.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "policy_host/onnx_engine/node.hpp"
#include "policy_host/onnx_engine/screen.hpp"

namespace takt::onnx_engine {

namespace {

using Names = std::set<std::string, std::less<>>;

constexpr int kStartState = 5;  // the input of LSTM, GRU and RNN that has it

bool is_recurrent(const onnx::NodeProto& node) {
  return node.op_type() == "LSTM" || node.op_type() == "GRU" || node.op_type() == "RNN";
}

// What these say follows from shapes, which are fixed.
bool only_looks_at_shapes(const onnx::NodeProto& node) {
  return node.op_type() == "Shape" || node.op_type() == "Size" || node.op_type() == "ConstantOfShape";
}

// Of a graph within a node too, which reads what is around it. Protobuf's own limit on nesting bounds the recursion.
bool reads_any(const onnx::NodeProto& node, const Names& decided) {  // NOLINT(misc-no-recursion)
  if (std::ranges::any_of(node.input(), [&](const std::string& name) { return decided.contains(name); })) return true;
  return std::ranges::any_of(node.attribute(), [&](const onnx::AttributeProto& attribute) {
    return std::ranges::any_of(attribute.g().node(),
                               [&](const onnx::NodeProto& inner) { return reads_any(inner, decided); });
  });
}

// Values that an input of the network decides.
Names decided_by_inputs(const onnx::GraphProto& graph) {
  Names decided;
  for (const onnx::ValueInfoProto& input : graph.input()) decided.insert(input.name());
  for (const onnx::TensorProto& constant : graph.initializer()) decided.erase(constant.name());
  for (const onnx::NodeProto& node : graph.node())
    if (!only_looks_at_shapes(node) && reads_any(node, decided))
      decided.insert(node.output().begin(), node.output().end());
  return decided;
}

void settle_leading_dimensions(onnx::GraphProto& graph) {
  for (onnx::ValueInfoProto& input : *graph.mutable_input()) {
    if (!input.type().tensor_type().has_shape() || input.type().tensor_type().shape().dim_size() == 0) continue;
    auto& first = *input.mutable_type()->mutable_tensor_type()->mutable_shape()->mutable_dim(0);
    if (!first.has_dim_value()) first.set_dim_value(1);
  }
}

// As far as libonnx comes: what it does not know stays open.
void infer_shapes(onnx::ModelProto& model) {
  settle_leading_dimensions(*model.mutable_graph());
  const auto known = onnx::OpSchemaRegistry::DomainToVersionRange::Instance().Map().find(onnx::ONNX_DOMAIN);
  for (onnx::OperatorSetIdProto& opset : *model.mutable_opset_import())
    if (opset.domain().empty()) opset.set_version(std::min<std::int64_t>(opset.version(), known->second.second));
  try {
    onnx::shape_inference::InferShapes(model, onnx::OpSchemaRegistry::Instance(), {false, 0, true});
  } catch (const std::exception&) {
    return;  // what it has found until then counts
  }
}

std::optional<std::int64_t> dimension_of(const onnx::GraphProto& graph, std::string_view name, int dimension) {
  for (const auto* const values : {&graph.value_info(), &graph.input()}) {
    const auto value = std::ranges::find(*values, name, &onnx::ValueInfoProto::name);
    if (value == values->end()) continue;
    const auto& shape = value->type().tensor_type().shape();
    if (dimension < shape.dim_size() && shape.dim(dimension).has_dim_value()) return shape.dim(dimension).dim_value();
  }
  return std::nullopt;
}

// Recurrent nodes of branches and loops: how often those run, and from which state, this does not follow.
void collect_inner(const onnx::NodeProto& node, std::vector<std::string>& found) {  // NOLINT(misc-no-recursion)
  for (const onnx::AttributeProto& attribute : node.attribute()) {
    for (const onnx::NodeProto& inner : attribute.g().node()) {
      if (is_recurrent(inner)) found.push_back(describe(inner));
      collect_inner(inner, found);
    }
  }
}

int time_dimension(const onnx::NodeProto& node) {
  const auto layout = std::ranges::find(node.attribute(), "layout", &onnx::AttributeProto::name);
  return layout != node.attribute().end() && layout->i() == 1 ? 1 : 0;
}

}  // namespace

Memory memory_of(onnx::ModelProto model) {
  Memory memory;
  for (const onnx::NodeProto& node : model.graph().node()) collect_inner(node, memory.unclear);
  const Names decided = decided_by_inputs(model.graph());
  const auto begins_anew = [&](const onnx::NodeProto& node) {
    return is_recurrent(node) && node.input_size() > 0 &&
           (node.input_size() <= kStartState || !decided.contains(node.input(kStartState)));
  };
  if (std::ranges::none_of(model.graph().node(), begins_anew)) return memory;
  infer_shapes(model);
  for (const onnx::NodeProto& node : model.graph().node()) {
    if (!begins_anew(node)) continue;
    const auto steps = dimension_of(model.graph(), node.input(0), time_dimension(node));
    if (!steps) memory.unclear.push_back(describe(node));
    if (steps && *steps == 1) memory.lost.push_back(describe(node));
  }
  return memory;
}

}  // namespace takt::onnx_engine
