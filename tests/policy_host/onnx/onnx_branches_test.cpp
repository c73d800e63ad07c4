// SPDX-License-Identifier: Apache-2.0
// Goal: of an If's two graphs the chosen one alone decides, whatever both call their values; a truth that is not a
// number chooses neither; and what cannot be evaluated is refused with its place. Method: small graphs, one deviation
// at a time; policy_trial_test compares larger ones with ONNX Runtime.
#include <cmath>
#include <limits>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

// OUT = x OP inner, where inner = x + w.
onnx::GraphProto branch(const std::string& op, float w) {
  GraphMaker maker;
  maker.output("out").floats("w", {1}, {w});
  maker.node("Add", {"x", "w"}, {"inner"});
  maker.node(op, {"x", "inner"}, {"out"});
  return maker.graph();
}

// truth > 0 ? x * (x + 10) : x - (x + 20)
GraphMaker choosing(const onnx::GraphProto& then_branch = branch("Mul", 10),
                    const onnx::GraphProto& else_branch = branch("Sub", 20)) {
  GraphMaker maker;
  maker.input("x", {2}).input("truth", {1}).output("out").floats("zero", {1}, {0});
  maker.node("Greater", {"truth", "zero"}, {"chosen"});
  maker.node("If", {"chosen"}, {"out"}).with("then_branch", then_branch).with("else_branch", else_branch);
  return maker;
}

TEST(Branches, TheChosenOneDecides) {
  expect_near(evaluate(choosing(), {{1, 2}, {1}}), {2}, {11, 24});
  expect_near(evaluate(choosing(), {{1, 2}, {-1}}), {2}, {-20, -20});
}

TEST(Branches, ATruthThatIsNotANumberChoosesNeither) {
  const Result result = evaluate(choosing(), {{1, 2}, {std::numeric_limits<float>::quiet_NaN()}});
  ASSERT_EQ(result.values.size(), 2U);
  for (const float value : result.values) EXPECT_TRUE(std::isnan(value)) << value;
}

TEST(Branches, OneInAnother) {
  GraphMaker inner;
  inner.output("out").floats("five", {1}, {5});
  inner.node("Greater", {"truth", "five"}, {"chosen within"});
  inner.node("If", {"chosen within"}, {"out"})
      .with("then_branch", branch("Mul", 1))
      .with("else_branch", branch("Mul", 2));
  const GraphMaker maker = choosing(inner.graph());
  expect_near(evaluate(maker, {{1, 2}, {9}}), {2}, {2, 6});
  expect_near(evaluate(maker, {{1, 2}, {3}}), {2}, {3, 8});
  expect_near(evaluate(maker, {{1, 2}, {-3}}), {2}, {-20, -20});
}

TEST(Branches, AWholeNumberDecidesByItsRemainder) {
  GraphMaker maker;
  maker.input("x", {2}).input("count", {}).output("out").integers("three", {}, {3}).integers("two", {}, {2});
  maker.graph().mutable_input(1)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_INT64);
  maker.node("Mod", {"count", "three"}, {"rest"});
  maker.node("Equal", {"rest", "two"}, {"chosen"});
  maker.node("If", {"chosen"}, {"out"}).with("then_branch", branch("Mul", 10)).with("else_branch", branch("Sub", 20));
  for (const auto& [count, chosen] : {std::pair{0.0F, false},
                                      {1.0F, false},
                                      {2.0F, true},
                                      {5.0F, true},
                                      {-1.0F, true},
                                      {16777214.0F, true},
                                      {16777216.0F, false},
                                      {2.9F, true},
                                      {-4.5F, true}})
    expect_near(evaluate(maker, {{1, 2}, {count}}), {2},
                chosen ? std::vector<float>{11, 24} : std::vector{-20.F, -20.F});
}

TEST(Branches, AreRefusedWhereTheyCannotBeEvaluated) {
  EXPECT_EQ(choosing().refusal(), "");
  const auto expect_refused = [](const GraphMaker& maker, const std::string& what) {
    EXPECT_NE(maker.refusal().find(what), std::string::npos) << what << " not in: " << maker.refusal();
  };
  expect_refused(choosing(branch("Cosh", 1)), "Cosh node");
  onnx::GraphProto wider = branch("Mul", 1);
  *wider.mutable_initializer(0) = float_tensor("w", {3, 1}, {1, 2, 3});
  expect_refused(choosing(wider), "[3, 2]");
  onnx::GraphProto stranger = branch("Mul", 1);
  stranger.mutable_node(1)->set_input(1, "nowhere");
  EXPECT_NE(choosing(stranger).refusal(), "");
  onnx::GraphProto damaged = branch("Mul", 1);
  damaged.mutable_initializer(0)->add_dims(7);
  expect_refused(choosing(damaged), "damaged");
  GraphMaker by_number = choosing();
  by_number.graph().mutable_node(1)->set_input(0, "truth");
  EXPECT_NE(by_number.refusal(), "");
  // What one branch made is not found outside.
  GraphMaker outside = choosing();
  outside.graph().mutable_node(1)->set_output(0, "chosen out");
  outside.node("Tanh", {"inner"}, {"out"});
  EXPECT_NE(outside.refusal(), "");

  onnx::GraphProto deep = branch("Mul", 1);
  for (int i = 0; i < 12; ++i) deep = choosing(deep).graph();
  EXPECT_NE(choosing(deep).refusal(), "");
}

}  // namespace
}  // namespace takt::onnx_engine
