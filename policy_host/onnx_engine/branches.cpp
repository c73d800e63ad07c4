// SPDX-License-Identifier: Apache-2.0
// If: one of two graphs, by a truth that an input decides. Only the chosen one runs.
//
// Both make the same shapes, known at load. Not a number as the truth is not a number in every output.
#include <fmt/format.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/screen.hpp"

namespace takt::onnx_engine {

namespace {

using Steps = std::vector<std::unique_ptr<Step>>;

struct Branch {
  Steps steps;
  std::vector<const Value*> outputs;
};

Branch build_branch(Builder& builder, const Node& node, std::string_view name) {
  const onnx::GraphProto* const graph = node.graph(name);
  if (graph == nullptr) node.refuse(fmt::format("it has no {}", name));
  if (graph->input_size() > 0) node.refuse(fmt::format("its {} has inputs of its own", name));
  if (static_cast<std::size_t>(graph->output_size()) != node.output_count())
    node.refuse(fmt::format("its {} has {} outputs, the node {}", name, graph->output_size(), node.output_count()));
  Branch branch;
  builder.begin_branch();
  build_graph(builder, *graph);
  for (const onnx::ValueInfoProto& output : graph->output()) {
    const Value* const value = builder.find(output.name());
    if (value == nullptr) node.refuse(fmt::format("no node of its {} makes '{}'", name, output.name()));
    if (value->type != ElementType::float32 && value->type != ElementType::boolean)
      node.beyond(fmt::format("output '{}' of its {} is {}; only float32 and bool are supported", output.name(), name,
                              to_text(value->type)));
    branch.outputs.push_back(value);
  }
  branch.steps = builder.end_branch();
  return branch;
}

struct Choice {
  const float *then_values, *else_values;
  float* to;
  std::size_t count;
};

}  // namespace

void build_graph(Builder& builder, const onnx::GraphProto& graph) {
  for (const onnx::TensorProto& tensor : graph.initializer()) define_constant(builder, tensor.name(), tensor);
  for (const onnx::NodeProto& proto : graph.node()) {
    find_operator(proto.op_type())(builder, Node(proto, builder));
    builder.count_operator(proto.op_type());
  }
}

void build_if(Builder& builder, const Node& node) {
  const Value& truth = node.input(0);
  if (truth.type != ElementType::boolean || elements(truth.shape) != 1) node.refuse("input 0 must be one bool");
  const float* const by = truth.floats;
  Branch then_branch = build_branch(builder, node, "then_branch");
  Branch else_branch = build_branch(builder, node, "else_branch");
  std::vector<Choice> choices;
  for (std::size_t i = 0; i < node.output_count(); ++i) {
    const Value &a = *then_branch.outputs[i], &b = *else_branch.outputs[i];
    if (a.shape != b.shape || a.type != b.type)
      node.beyond(fmt::format("output '{}' is {} {} in one branch, {} {} in the other", node.output(i), to_text(a.type),
                              to_text(a.shape), to_text(b.type), to_text(b.shape)));
    const Value& out = builder.define_floats(node.output(i), a.shape, a.type);
    choices.push_back({a.floats, b.floats, out.floats, elements(a.shape)});
  }
  builder.each_run([by, choices = std::move(choices), then_steps = std::move(then_branch.steps),
                    else_steps = std::move(else_branch.steps)]() noexcept {
    const float truth_now = *by;
    const bool chosen = truth_now != 0.0F;
    for (const std::unique_ptr<Step>& step : chosen ? then_steps : else_steps) step->run();
    for (const Choice& choice : choices) {
      if (std::isnan(truth_now)) {
        std::fill_n(choice.to, choice.count, truth_now);
      } else {
        std::copy_n(chosen ? choice.then_values : choice.else_values, choice.count, choice.to);
      }
    }
  });
}

}  // namespace takt::onnx_engine
