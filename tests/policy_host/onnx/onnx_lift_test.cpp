// SPDX-License-Identifier: Apache-2.0
// Goal: models of opsets before 8 compute what their own opset says, where that differs from today's operators; what
// cannot be lifted is refused. Method: small models of opset 6 with numbers that tell the two meanings apart.
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

void expect_refused(const GraphMaker& maker, const std::string& part) {
  const std::string refusal = maker.refusal();
  EXPECT_NE(refusal.find(part), std::string::npos) << (refusal.empty() ? "was accepted" : refusal);
}

GraphMaker of_opset_6(const std::string& op, const Dims& input, const Dims& second) {
  GraphMaker maker(6);
  maker.model.set_ir_version(4);  // initializers are no inputs
  std::vector<float> values(static_cast<std::size_t>(second[0]));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(10 * (i + 1));
  maker.input("x", input).output("z").floats("b", second, values).node(op, {"x", "b"}, {"z"});
  return maker;
}

NodeMaker first_node(GraphMaker& maker) {
  return NodeMaker(*maker.graph().mutable_node(0));
}

// b has one number for each of the middle dimension: today's broadcasting would take the last.
TEST(Lift, AnAxisAlignsTheSecondOperand) {
  GraphMaker maker = of_opset_6("Add", {1, 2, 2}, {2});
  first_node(maker).with("broadcast", std::int64_t{1}).with("axis", std::int64_t{1});
  expect_near(evaluate(maker, {{1, 2, 3, 4}}), {1, 2, 2}, {11, 12, 23, 24});

  GraphMaker from_behind = of_opset_6("Sub", {2, 2, 1}, {2});
  first_node(from_behind).with("broadcast", std::int64_t{1}).with("axis", std::int64_t{-2});
  expect_near(evaluate(from_behind, {{1, 2, 3, 4}}), {2, 2, 1}, {-9, -18, -7, -16});

  GraphMaker at_the_end = of_opset_6("Mul", {2, 2}, {2});
  first_node(at_the_end).with("broadcast", std::int64_t{1});
  expect_near(evaluate(at_the_end, {{1, 2, 3, 4}}), {2, 2}, {10, 40, 30, 80});
}

TEST(Lift, ShapesThatDifferNeedTheBroadcastAttribute) {
  expect_refused(of_opset_6("Add", {2, 2}, {2}), "differ in shape");
  GraphMaker beside = of_opset_6("Add", {2, 2}, {2});
  first_node(beside).with("broadcast", std::int64_t{1}).with("axis", std::int64_t{2});
  EXPECT_NE(beside.refusal(), "");
}

TEST(Lift, SlopesOfPReluAreByChannel) {
  const GraphMaker maker = of_opset_6("PRelu", {1, 2, 2}, {2});
  expect_near(evaluate(maker, {{-1, 2, -3, -4}}), {1, 2, 2}, {-10, 2, -60, -80});
}

TEST(Lift, TrainingIsNotTakenForInference) {
  GraphMaker trained(6);
  trained.input("x", {1, 2}).output("z").node("Dropout", {"x"}, {"z"});
  expect_refused(trained, "exported for training");
  first_node(trained).with("is_test", std::int64_t{1});
  expect_near(evaluate(trained, {{1, 2}}), {1, 2}, {1, 2});
}

TEST(Lift, AnAttributeThatBecameAnInput) {
  GraphMaker maker(4);
  maker.input("x", {2, 3}).output("z").node("Reshape", {"x"}, {"z"}).with("shape", Dims{3, 2});
  expect_near(evaluate(maker, {{1, 2, 3, 4, 5, 6}}), {3, 2}, {1, 2, 3, 4, 5, 6});
}

TEST(Lift, DefaultsAreThoseOfTheOldOpset) {
  GraphMaker selu(1);
  selu.input("x", {1}).output("z").node("Selu", {"x"}, {"z"});
  expect_near(evaluate(selu, {{-100}}), {1}, {-1.6732F * 1.0507F}, 1e-7F);
  GraphMaker concat(3);
  concat.input("x", {1, 2}).output("z").node("Concat", {"x", "x"}, {"z"});
  expect_near(evaluate(concat, {{1, 2}}), {1, 4}, {1, 2, 1, 2});
}

TEST(Lift, TruthsAreAlignedToo) {
  GraphMaker maker = of_opset_6("Greater", {1, 2, 2}, {2});
  first_node(maker).with("broadcast", std::int64_t{1}).with("axis", std::int64_t{1});
  maker.graph().mutable_output(0)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_BOOL);
  expect_near(evaluate(maker, {{11, 9, 21, 19}}), {1, 2, 2}, {1, 0, 1, 0});
}

TEST(Lift, TheModelKeepsItsOwnOpset) {
  GraphMaker maker(6);
  maker.input("x", {2}).output("z").node("Tanh", {"x"}, {"z"});
  const auto model = maker.load();
  ASSERT_TRUE(model) << model.error();
  EXPECT_EQ(model->opset(), 6);
}

TEST(Lift, AnOperatorThatChangedOtherwiseIsRefused) {
  GraphMaker recurrent(6);
  recurrent.input("x", {3, 1, 1}).output("z");
  recurrent.floats("w", {1, 4, 1}, {1, 1, 1, 1}).floats("r", {1, 4, 1}, {1, 1, 1, 1});
  recurrent.model.set_ir_version(4);
  recurrent.node("LSTM", {"x", "w", "r"}, {"z"}).with("hidden_size", std::int64_t{1});
  expect_refused(recurrent, "means something else from opset 8 on");
  GraphMaker unknown(6);
  unknown.input("x", {2, 2}).output("z").node("Gemm", {"x", "missing", "x"}, {"z"});
  EXPECT_NE(unknown.refusal(), "");
}

}  // namespace
}  // namespace takt::onnx_engine
