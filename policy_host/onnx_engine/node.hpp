// SPDX-License-Identifier: Apache-2.0
// What an operator sees of its node: inputs with their shapes, attributes with their defaults, and a way to refuse.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "policy_host/onnx_engine/builder.hpp"

namespace onnx {
class AttributeProto;
class GraphProto;
class NodeProto;
class TensorProto;
}  // namespace onnx

namespace takt::onnx_engine {

// "Gemm node 'actor.0'": the node's name, or that of its first output where the exporter gave none.
std::string describe(const onnx::NodeProto& proto);

class Node {
 public:
  Node(const onnx::NodeProto& proto, const Builder& builder) : proto_(proto), builder_(builder) {}

  std::size_t input_count() const;
  bool has_input(std::size_t i) const;  // optional inputs may be left out or named ""
  const Value& input(std::size_t i) const;
  const Value& float_input(std::size_t i) const;
  const std::vector<std::int64_t>& integer_input(std::size_t i) const;

  std::size_t output_count() const;
  bool has_output(std::size_t i) const;
  std::string output(std::size_t i = 0) const;  // "" when it is not used

  bool has_attribute(std::string_view name) const { return find_attribute(name) != nullptr; }
  std::int64_t integer(std::string_view name, std::int64_t otherwise) const;
  float number(std::string_view name, float otherwise) const;
  std::string text(std::string_view name, const std::string& otherwise) const;
  std::optional<std::vector<std::int64_t>> integers(std::string_view name) const;
  std::vector<float> numbers(std::string_view name) const;
  std::vector<std::string> texts(std::string_view name) const;
  const onnx::TensorProto* tensor(std::string_view name) const;  // null: it has none
  const onnx::GraphProto* graph(std::string_view name) const;    // likewise

  // `axes` moved from the attributes to the inputs as the opsets went on: whichever the node has.
  std::optional<std::vector<std::int64_t>> axes(std::size_t input) const;
  // A negative axis counts from the end; refuses one outside [-rank, rank).
  std::size_t axis(std::int64_t axis, std::size_t rank) const;

  std::string description() const;
  [[noreturn]] void refuse(const std::string& why) const;  // the file is wrong
  [[noreturn]] void beyond(const std::string& why) const;  // the file may be right, and this engine cannot do it

 private:
  const onnx::AttributeProto* find_attribute(std::string_view name) const;
  const onnx::AttributeProto* find_attribute(std::string_view name, int type) const;  // refuses one of another kind

  const onnx::NodeProto& proto_;
  const Builder& builder_;
};

}  // namespace takt::onnx_engine
