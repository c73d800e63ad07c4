// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/lift.hpp"

#include <fmt/format.h>
#include <onnx/defs/schema.h>
#include <onnx/onnx_pb.h>
#include <onnx/shape_inference/implementation.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/node.hpp"
#include "policy_host/onnx_engine/screen.hpp"

namespace takt::onnx_engine {

namespace {

// What changed before opset 8, and is settled below.
constexpr auto kAligned = std::to_array<std::string_view>(
    {"Add", "And", "Div", "Equal", "Greater", "Less", "Mul", "Or", "Pow", "Sub", "Xor"});
constexpr auto kTrained = std::to_array<std::string_view>({"BatchNormalization", "Dropout"});
constexpr auto kOtherwise = std::to_array<std::string_view>({"Concat", "Gemm", "PRelu", "Reshape", "Selu"});
// Only how to compute it was said otherwise (consumed_inputs), or newer ones take more.
constexpr auto kAlike = std::to_array<std::string_view>(
    {"Abs",       "AveragePool", "Ceil", "Clip",    "Elu",  "Exp", "Floor", "HardSigmoid", "InstanceNormalization",
     "LeakyRelu", "Log",         "Max",  "MaxPool", "Mean", "Min", "Neg",   "Reciprocal",  "Relu",
     "Sigmoid",   "Sqrt",        "Sum",  "Tanh"});
constexpr float kSeluAlpha = 1.6732F, kSeluGamma = 1.0507F;  // defaults before opset 6
constexpr std::int64_t kInitializersAlone = 4;  // the first version of the file's form in which they need no input
constexpr std::int64_t kSeluChanged = 6, kReshapeChanged = 5;
constexpr std::int64_t kNumpyBroadcasting = 7;  // the first opset that aligns the last dimensions, as NumPy does

bool is_one_of(const auto& names, std::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

void infer_every_shape(onnx::ModelProto& model) {
  onnx::shape_inference::InferShapes(model, onnx::OpSchemaRegistry::Instance(), {true, 1, true});
}

std::optional<Shape> shape_of(const onnx::GraphProto& graph, std::string_view name) {
  for (const auto* const values : {&graph.value_info(), &graph.input(), &graph.output()}) {
    const auto value = std::ranges::find(*values, name, &onnx::ValueInfoProto::name);
    if (value == values->end() || !value->type().tensor_type().has_shape()) continue;
    Shape shape;
    for (const auto& dim : value->type().tensor_type().shape().dim()) shape.push_back(dim.dim_value());
    return shape;
  }
  const auto weights = std::ranges::find(graph.initializer(), name, &onnx::TensorProto::name);
  if (weights == graph.initializer().end()) return std::nullopt;
  return Shape{weights->dims().begin(), weights->dims().end()};
}

Shape known_shape(const onnx::GraphProto& graph, const onnx::NodeProto& node, int input) {
  const auto shape = input < node.input_size() ? shape_of(graph, node.input(input)) : std::nullopt;
  if (!shape)
    throw Beyond(fmt::format("{} of an old opset: the shape of its input {} is not known", describe(node), input));
  return *shape;
}

std::int64_t integer_of(const onnx::NodeProto& node, std::string_view name, std::int64_t otherwise) {
  const auto found = std::ranges::find(node.attribute(), name, &onnx::AttributeProto::name);
  return found == node.attribute().end() ? otherwise : found->i();
}

void remove_attribute(onnx::NodeProto& node, std::string_view name) {
  auto& attributes = *node.mutable_attribute();
  for (int i = attributes.size(); i-- > 0;)
    if (attributes[i].name() == name) attributes.DeleteSubrange(i, 1);
}

// How many dimensions of 1 the second operand lacks behind its last to meet the first as the old opset means it.
std::size_t missing_behind(const onnx::GraphProto& graph, const onnx::NodeProto& node) {
  const Shape first = known_shape(graph, node, 0), second = known_shape(graph, node, 1);
  if (node.op_type() == "PRelu") {  // a slope for each channel
    const bool by_channel = second.size() == 1 && second[0] != 1 && first.size() > 2;
    return by_channel ? first.size() - 2 : 0;
  }
  const auto rank = static_cast<std::int64_t>(first.size()), own = static_cast<std::int64_t>(second.size());
  if (integer_of(node, "broadcast", 0) == 0) {
    if (first != second)
      throw Beyond(fmt::format("{} of an old opset: its inputs {} and {} differ in shape", describe(node),
                               to_text(first), to_text(second)));
    return 0;
  }
  std::int64_t axis = integer_of(node, "axis", rank - own);
  if (axis < 0) axis += rank;
  if (axis < 0 || axis + own > rank)
    throw Refusal(
        fmt::format("{}: {} does not lie on {} from axis {}", describe(node), to_text(second), to_text(first), axis));
  return static_cast<std::size_t>(rank - axis - own);
}

onnx::NodeProto unsqueeze_behind(const onnx::GraphProto& graph, const onnx::NodeProto& node, std::size_t count) {
  const std::size_t rank = known_shape(graph, node, 1).size();
  onnx::NodeProto made;
  made.set_op_type("Unsqueeze");
  made.set_name(fmt::format("{} aligned", describe(node)));
  made.add_input(node.input(1));
  made.add_output(fmt::format("{} aligned for {}", node.input(1), node.output(0)));
  onnx::AttributeProto& axes = *made.add_attribute();
  axes.set_name("axes");
  axes.set_type(onnx::AttributeProto_AttributeType_INTS);
  for (std::size_t i = 0; i < count; ++i) axes.add_ints(static_cast<std::int64_t>(rank + i));
  return made;
}

void refuse_training(const onnx::NodeProto& node) {
  if (is_one_of(kTrained, node.op_type()) && integer_of(node, "is_test", 0) == 0)
    throw Beyond(fmt::format("{} has no is_test: it is exported for training", describe(node)));
}

void need_attribute(onnx::NodeProto& node, const char* name, float otherwise) {
  if (std::ranges::find(node.attribute(), name, &onnx::AttributeProto::name) != node.attribute().end()) return;
  onnx::AttributeProto& attribute = *node.add_attribute();
  attribute.set_name(name);
  attribute.set_type(onnx::AttributeProto_AttributeType_FLOAT);
  attribute.set_f(otherwise);
}

// Concat's, which must be there from opset 4 on.
void need_axis(onnx::NodeProto& node) {
  if (std::ranges::find(node.attribute(), "axis", &onnx::AttributeProto::name) != node.attribute().end()) return;
  onnx::AttributeProto& attribute = *node.add_attribute();
  attribute.set_name("axis");
  attribute.set_type(onnx::AttributeProto_AttributeType_INT);
  attribute.set_i(1);
}

// Exporters of that time wrote integers as a Constant, which the standard lets hold them from opset 9 on.
void make_constants_initializers(onnx::GraphProto& graph) {
  auto& nodes = *graph.mutable_node();
  for (int n = nodes.size(); n-- > 0;) {
    if (nodes[n].op_type() != "Constant" || nodes[n].attribute_size() != 1 || nodes[n].output_size() != 1) continue;
    onnx::AttributeProto& value = *nodes[n].mutable_attribute(0);
    if (value.name() != "value" || !value.has_t()) continue;
    value.mutable_t()->set_name(nodes[n].output(0));
    graph.add_initializer()->Swap(value.mutable_t());
    nodes.DeleteSubrange(n, 1);
  }
}

// The attribute becomes the second input.
void take_shape_as_input(onnx::GraphProto& graph, onnx::NodeProto& node) {
  const auto shape = std::ranges::find(node.attribute(), "shape", &onnx::AttributeProto::name);
  if (shape == node.attribute().end() || node.input_size() != 1)
    throw Refusal(fmt::format("{} has no attribute `shape`", describe(node)));
  onnx::TensorProto& tensor = *graph.add_initializer();
  tensor.set_name(fmt::format("{} shape", node.output(0)));
  tensor.set_data_type(onnx::TensorProto_DataType_INT64);
  tensor.add_dims(shape->ints_size());
  for (const std::int64_t dim : shape->ints()) tensor.add_int64_data(dim);
  node.add_input(tensor.name());
  remove_attribute(node, "shape");
}

void refuse_other_changes(const onnx::NodeProto& node, std::int64_t from, std::int64_t to) {
  const std::string& op = node.op_type();
  if (is_one_of(kAligned, op) || is_one_of(kTrained, op) || is_one_of(kOtherwise, op) || is_one_of(kAlike, op)) return;
  const auto schema = [&](std::int64_t opset) {
    return onnx::OpSchemaRegistry::Schema(op, static_cast<int>(opset), onnx::ONNX_DOMAIN);
  };
  const auto *before = schema(from), *after = schema(to);
  if (before == nullptr || after == nullptr || before->since_version() != after->since_version())
    throw Beyond(fmt::format("{} of opset {}: it means something else from opset {} on, and is not lifted",
                             describe(node), from, to));
}

// What stands before the node is added to `nodes`.
void lift_node(onnx::GraphProto& graph, onnx::NodeProto& node, std::int64_t opset,
               std::vector<onnx::NodeProto>& nodes) {
  const std::string op = node.op_type();
  if (opset < kNumpyBroadcasting && (is_one_of(kAligned, op) || op == "PRelu")) {
    if (const std::size_t missing = missing_behind(graph, node); missing > 0) {
      nodes.push_back(unsqueeze_behind(graph, node, missing));
      node.set_input(1, nodes.back().output(0));
    }
  }
  if (op == "Reshape" && opset < kReshapeChanged) take_shape_as_input(graph, node);
  if (op == "Concat") need_axis(node);
  if (op == "Selu" && opset < kSeluChanged) {
    need_attribute(node, "alpha", kSeluAlpha);
    need_attribute(node, "gamma", kSeluGamma);
  }
  if (opset < kNumpyBroadcasting) refuse_training(node);
  for (const char* name : {"broadcast", "consumed_inputs", "is_test"}) remove_attribute(node, name);
  if (is_one_of(kAligned, op)) remove_attribute(node, "axis");
}

void set_opset(onnx::ModelProto& model, std::int64_t opset) {
  for (onnx::OperatorSetIdProto& set : *model.mutable_opset_import())
    if (set.domain().empty() || set.domain() == "ai.onnx") set.set_version(opset);
}

}  // namespace

void lift(onnx::ModelProto& model, std::int64_t target) {
  const std::int64_t opset = opset_of(model);
  onnx::GraphProto& graph = *model.mutable_graph();
  for (const onnx::NodeProto& node : graph.node()) {
    if (std::ranges::any_of(node.attribute(), [](const auto& attribute) { return attribute.has_g(); }))
      throw Beyond(fmt::format("{} of opset {}: branches are taken from opset {} on", describe(node), opset, target));
    refuse_other_changes(node, opset, target);
  }
  make_constants_initializers(graph);
  model.set_ir_version(std::max(model.ir_version(), kInitializersAlone));
  infer_every_shape(model);
  std::vector<onnx::NodeProto> nodes;
  for (onnx::NodeProto& node : *graph.mutable_node()) {
    lift_node(graph, node, opset, nodes);
    nodes.push_back(node);
  }
  graph.clear_node();
  for (onnx::NodeProto& node : nodes) graph.add_node()->Swap(&node);
  set_opset(model, target);
}

}  // namespace takt::onnx_engine
