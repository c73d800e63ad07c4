// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/node.hpp"

#include <fmt/format.h>
#include <onnx/onnx_pb.h>

namespace takt::onnx_engine {

std::string describe(const onnx::NodeProto& proto) {
  const std::string& name = proto.name().empty() && proto.output_size() > 0 ? proto.output(0) : proto.name();
  return fmt::format("{} node '{}'", proto.op_type(), name);
}

std::size_t Node::input_count() const {
  return static_cast<std::size_t>(proto_.input_size());
}

bool Node::has_input(std::size_t i) const {
  return i < input_count() && !proto_.input(static_cast<int>(i)).empty();
}

const Value& Node::input(std::size_t i) const {
  if (!has_input(i)) refuse(fmt::format("input {} is missing", i));
  const std::string& name = proto_.input(static_cast<int>(i));
  const Value* value = builder_.find(name);
  if (value == nullptr) refuse(fmt::format("reads '{}' before any node has made it", name));
  return *value;
}

const Value& Node::float_input(std::size_t i) const {
  const Value& value = input(i);
  if (value.type != ElementType::float32)
    beyond(fmt::format("input {} must be float32, it is {}", i, to_text(value.type)));
  return value;
}

const std::vector<std::int64_t>& Node::integer_input(std::size_t i) const {
  const Value& value = input(i);
  if (value.type != ElementType::int64) beyond(fmt::format("input {} must be int64 and known at load", i));
  return value.integers;
}

std::size_t Node::output_count() const {
  return static_cast<std::size_t>(proto_.output_size());
}

bool Node::has_output(std::size_t i) const {
  return !output(i).empty();
}

std::string Node::output(std::size_t i) const {
  return i < static_cast<std::size_t>(proto_.output_size()) ? proto_.output(static_cast<int>(i)) : std::string();
}

const onnx::AttributeProto* Node::find_attribute(std::string_view name) const {
  for (const onnx::AttributeProto& attribute : proto_.attribute()) {
    if (attribute.name() == name) return &attribute;
  }
  return nullptr;
}

const onnx::AttributeProto* Node::find_attribute(std::string_view name, int type) const {
  const onnx::AttributeProto* attribute = find_attribute(name);
  if (attribute != nullptr && attribute->type() != type) {
    refuse(fmt::format("attribute '{}' is of another kind than the operator's", name));
  }
  return attribute;
}

std::int64_t Node::integer(std::string_view name, std::int64_t otherwise) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_INT);
  return attribute == nullptr ? otherwise : attribute->i();
}

float Node::number(std::string_view name, float otherwise) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_FLOAT);
  return attribute == nullptr ? otherwise : attribute->f();
}

std::string Node::text(std::string_view name, const std::string& otherwise) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_STRING);
  return attribute == nullptr ? otherwise : attribute->s();
}

std::optional<std::vector<std::int64_t>> Node::integers(std::string_view name) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_INTS);
  if (attribute == nullptr) return std::nullopt;
  return std::vector<std::int64_t>(attribute->ints().begin(), attribute->ints().end());
}

std::vector<float> Node::numbers(std::string_view name) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_FLOATS);
  if (attribute == nullptr) return {};
  return {attribute->floats().begin(), attribute->floats().end()};
}

std::vector<std::string> Node::texts(std::string_view name) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_STRINGS);
  if (attribute == nullptr) return {};
  return {attribute->strings().begin(), attribute->strings().end()};
}

const onnx::TensorProto* Node::tensor(std::string_view name) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_TENSOR);
  return attribute == nullptr ? nullptr : &attribute->t();
}

const onnx::GraphProto* Node::graph(std::string_view name) const {
  const onnx::AttributeProto* attribute = find_attribute(name, onnx::AttributeProto_AttributeType_GRAPH);
  return attribute == nullptr ? nullptr : &attribute->g();
}

std::optional<std::vector<std::int64_t>> Node::axes(std::size_t input) const {
  if (has_input(input)) return integer_input(input);
  return integers("axes");
}

std::size_t Node::axis(std::int64_t axis, std::size_t rank) const {
  const auto signed_rank = static_cast<std::int64_t>(rank);
  if (axis < -signed_rank || axis >= signed_rank) refuse(fmt::format("axis {} is outside a rank of {}", axis, rank));
  return static_cast<std::size_t>(axis < 0 ? axis + signed_rank : axis);
}

std::string Node::description() const {
  return describe(proto_);
}

void Node::refuse(const std::string& why) const {
  throw Refusal(fmt::format("{}: {}", describe(proto_), why));
}

void Node::beyond(const std::string& why) const {
  throw Beyond(fmt::format("{}: {}", describe(proto_), why));
}

}  // namespace takt::onnx_engine
