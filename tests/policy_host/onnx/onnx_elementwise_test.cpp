// SPDX-License-Identifier: Apache-2.0
// Goal: binary arithmetic with every kind of NumPy broadcasting. Method: sums small enough to do in the head, and a
// comparison of all shape pairs of up to three dimensions with an index-by-index reference.
#include <algorithm>
#include <cmath>
#include <limits>

#include "policy_host/onnx_engine/broadcast.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

Result binary(const std::string& op, const Dims& a_shape, const std::vector<float>& a, const Dims& b_shape,
              const std::vector<float>& b) {
  GraphMaker maker;
  maker.input("a", a_shape).input("b", b_shape).output("y").node(op, {"a", "b"}, {"y"});
  return evaluate(maker, {a, b});
}

TEST(Elementwise, FourOperationsOnEqualShapes) {
  const std::vector<float> a{6, 8, 10};
  const std::vector<float> b{2, 4, 5};
  EXPECT_EQ(binary("Add", {3}, a, {3}, b).values, (std::vector<float>{8, 12, 15}));
  EXPECT_EQ(binary("Sub", {3}, a, {3}, b).values, (std::vector<float>{4, 4, 5}));
  EXPECT_EQ(binary("Mul", {3}, a, {3}, b).values, (std::vector<float>{12, 32, 50}));
  EXPECT_EQ(binary("Div", {3}, a, {3}, b).values, (std::vector<float>{3, 2, 2}));
}

TEST(Elementwise, RowColumnAndScalarBroadcast) {
  // [[1 2 3] [4 5 6]] - [10 20 30], - [[100] [200]], - 1; and the other way round
  const std::vector<float> a{1, 2, 3, 4, 5, 6};
  EXPECT_EQ(binary("Sub", {2, 3}, a, {3}, {10, 20, 30}), (Result{{2, 3}, {-9, -18, -27, -6, -15, -24}}));
  EXPECT_EQ(binary("Sub", {2, 3}, a, {2, 1}, {100, 200}), (Result{{2, 3}, {-99, -98, -97, -196, -195, -194}}));
  EXPECT_EQ(binary("Sub", {2, 3}, a, {}, {1}), (Result{{2, 3}, {0, 1, 2, 3, 4, 5}}));
  EXPECT_EQ(binary("Sub", {3}, {10, 20, 30}, {2, 3}, a), (Result{{2, 3}, {9, 18, 27, 6, 15, 24}}));
  EXPECT_EQ(binary("Sub", {2, 1}, {10, 20}, {1, 3}, {1, 2, 3}), (Result{{2, 3}, {9, 8, 7, 19, 18, 17}}));
}

TEST(Elementwise, PowerOfTwoHalfAndOthers) {
  EXPECT_EQ(binary("Pow", {3}, {-3, 2, 1.5F}, {}, {2}).values, (std::vector<float>{9, 4, 2.25F}));
  EXPECT_EQ(binary("Pow", {2}, {9, 2.25F}, {}, {0.5F}).values, (std::vector<float>{3, 1.5F}));
  expect_near(binary("Pow", {2}, {2, 3}, {2}, {3, -1}), {2}, {8, 1.0F / 3.0F});
}

// Every pair of shapes made of 1, 2 and 3 in up to three dimensions: 40 x 40 of them, a quarter of which broadcast.
TEST(Elementwise, AllSmallShapePairsAgreeWithTheDefinition) {
  std::vector<Shape> shapes{{}};
  for (std::size_t from = 0; from < shapes.size() && shapes[from].size() < 3; ++from) {
    for (const std::int64_t dim : {1, 2, 3}) {
      Shape longer = shapes[from];
      longer.push_back(dim);
      shapes.push_back(longer);
    }
  }
  // Offset of the element that result index `i` reads from an operand.
  const auto source = [](const Shape& operand, const Shape& result, std::size_t i) {
    std::size_t offset = 0;
    std::size_t step = 1;
    for (std::size_t d = result.size(); d-- > 0;) {
      const auto at = i % static_cast<std::size_t>(result[d]);
      i /= static_cast<std::size_t>(result[d]);
      if (d + operand.size() < result.size()) continue;
      const std::int64_t dim = operand[d + operand.size() - result.size()];
      if (dim != 1) offset += at * step;
      step *= static_cast<std::size_t>(dim);
    }
    return offset;
  };
  int broadcast = 0;
  for (const Shape& a : shapes) {
    for (const Shape& b : shapes) {
      const std::optional<Broadcast> plan = plan_broadcast(a, b);
      if (!plan) continue;
      ++broadcast;
      ASSERT_EQ(plan->left_offsets.size() * plan->length, elements(plan->shape));
      for (std::size_t i = 0; i < elements(plan->shape); ++i) {
        const std::size_t row = i / plan->length;
        const std::size_t within = i % plan->length;
        EXPECT_EQ(plan->left_offsets[row] + (plan->left_advances ? within : 0), source(a, plan->shape, i));
        EXPECT_EQ(plan->right_offsets[row] + (plan->right_advances ? within : 0), source(b, plan->shape, i));
      }
    }
  }
  EXPECT_GT(broadcast, 400);
}

TEST(Elementwise, IntegersAreWorkedOutAtLoad) {
  // x [2, 3] reshaped to (2 * 3 - 4 + 1, 6 / 3) = [3, 2]
  GraphMaker maker;
  maker.input("x", {2, 3}).output("y").integers("two", {1}, {2}).integers("three", {1}, {3}).integers("four", {1}, {4});
  maker.integers("one", {1}, {1}).integers("six", {1}, {6});
  maker.node("Mul", {"two", "three"}, {"product"});
  maker.node("Sub", {"product", "four"}, {"difference"});
  maker.node("Add", {"difference", "one"}, {"rows"});
  maker.node("Div", {"six", "three"}, {"columns"});
  maker.node("Concat", {"rows", "columns"}, {"shape"}).with("axis", std::int64_t{0});
  maker.node("Reshape", {"x", "shape"}, {"y"});
  EXPECT_EQ(evaluate(maker, {{1, 2, 3, 4, 5, 6}}), (Result{{3, 2}, {1, 2, 3, 4, 5, 6}}));
}

// A policy that sees not a number must not act on it: no choice, comparison or pooling swallows it.
TEST(Elementwise, NotANumberIsNeverChosenAway) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto ends_as_nan = [&](const auto& add_nodes) {
    GraphMaker maker;
    maker.input("x", {1, 1, 2}).output("y").floats("one", {1}, {1}).floats("two", {1}, {2});
    add_nodes(maker);
    for (const auto& x : {std::vector<float>{nan, 3}, std::vector<float>{3, nan}}) {
      const Result result = evaluate(maker, {x});
      EXPECT_TRUE(std::ranges::any_of(result.values, [](float y) { return std::isnan(y); }))
          << maker.graph().node(0).op_type();
    }
  };
  for (const char* op : {"Equal", "Greater", "GreaterOrEqual", "Less", "LessOrEqual"}) {
    ends_as_nan([op](GraphMaker& maker) {
      maker.node(op, {"x", "one"}, {"t"});
      maker.node("Where", {"t", "one", "two"}, {"y"});
    });
  }
  for (const char* op : {"Min", "Max"}) {
    ends_as_nan([op](GraphMaker& maker) { maker.node(op, {"x", "one"}, {"y"}); });
    ends_as_nan([op](GraphMaker& maker) { maker.node(op, {"one", "x"}, {"y"}); });
  }
  for (const char* op : {"MaxPool", "AveragePool"}) {
    ends_as_nan([op](GraphMaker& maker) { maker.node(op, {"x"}, {"y"}).with("kernel_shape", Dims{2}); });
  }
  for (const char* op : {"ReduceL2",
                         "ReduceMean",
                         "Softplus",
                         "Gelu",
                         "Abs",
                         "Exp",
                         "Log",
                         "Sin",
                         "Cos",
                         "Acos",
                         "Acosh",
                         "Asin",
                         "Asinh",
                         "Atan",
                         "Atanh",
                         "Cosh",
                         "Sinh",
                         "Tan",
                         "Ceil",
                         "Floor",
                         "Round",
                         "Sign",
                         "Selu",
                         "Celu",
                         "HardSigmoid",
                         "HardSwish",
                         "ThresholdedRelu",
                         "Shrink",
                         "Softsign",
                         "Mish",
                         "ReduceMax",
                         "ReduceMin",
                         "ReduceProd",
                         "ReduceL1",
                         "ReduceLogSum",
                         "ReduceLogSumExp",
                         "ReduceSumSquare",
                         "LogSoftmax",
                         "Hardmax",
                         "GlobalMaxPool",
                         "Dropout",
                         "Mean",
                         "Sum"}) {
    ends_as_nan([op](GraphMaker& maker) {
      maker.model.mutable_opset_import(0)->set_version(20);
      maker.node(op, {"x"}, {"y"});
    });
  }
  for (const char* op : {"ArgMax", "ArgMin"}) {
    ends_as_nan([op](GraphMaker& maker) {
      maker.node(op, {"x"}, {"i"}).with("axis", std::int64_t{2});
      maker.node("Cast", {"i"}, {"y"}).with("to", std::int64_t{onnx::TensorProto_DataType_FLOAT});
    });
  }
  for (const char* op : {"And", "Or", "Xor"}) {
    ends_as_nan([op](GraphMaker& maker) {
      maker.node("Greater", {"x", "one"}, {"t"});
      maker.node("Not", {"t"}, {"n"});
      maker.node(op, {"n", "t"}, {"u"});
      maker.node("Where", {"u", "one", "two"}, {"y"});
    });
  }
  ends_as_nan([](GraphMaker& maker) {
    maker.integers("index", {1}, {0}).floats("table", {3}, {0, 1, 2});
    maker.node("Cast", {"x"}, {"i"}).with("to", std::int64_t{onnx::TensorProto_DataType_INT64});
    maker.node("Gather", {"table", "i"}, {"y"});
  });
}

// As token ids and masks are: written as floats, cut to whole numbers and truths, and read as floats again.
TEST(Elementwise, WholeNumbersAndTruthsFromOutside) {
  GraphMaker maker;
  maker.input("i", {3}).input("t", {3}).output("sum").output("quotient").output("either").output("known");
  maker.integers("two", {1}, {2});
  maker.graph().mutable_input(0)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_INT64);
  maker.graph().mutable_input(1)->mutable_type()->mutable_tensor_type()->set_elem_type(onnx::TensorProto_DataType_BOOL);
  for (const int whole : {0, 1, 3})
    maker.graph().mutable_output(whole)->mutable_type()->mutable_tensor_type()->set_elem_type(
        onnx::TensorProto_DataType_INT64);
  maker.graph().mutable_output(2)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_BOOL);
  maker.node("Add", {"i", "two"}, {"sum"});
  maker.node("Div", {"i", "two"}, {"quotient"});
  maker.node("Not", {"t"}, {"either"});
  maker.node("Shape", {"i"}, {"known"});
  const std::vector<std::vector<float>> inputs{{-7.9F, 0.0F, 7.0F}, {0.0F, -3.0F, 1.0F}};
  expect_near(evaluate(maker, inputs, 0), {3}, {-5, 2, 9});
  expect_near(evaluate(maker, inputs, 1), {3}, {-3, 0, 3});
  expect_near(evaluate(maker, inputs, 2), {3}, {1, 0, 0});
  expect_near(evaluate(maker, inputs, 3), {1}, {3});
}

TEST(Elementwise, RefusesShapesThatDoNotBroadcastAndDivisionByZero) {
  GraphMaker shapes;
  shapes.input("a", {2}).input("b", {3}).output("y").node("Add", {"a", "b"}, {"y"});
  EXPECT_NE(shapes.refusal(), "");

  GraphMaker zero;
  zero.input("x", {1}).output("y").integers("a", {1}, {1}).integers("b", {1}, {0});
  zero.node("Div", {"a", "b"}, {"shape"});
  zero.node("Reshape", {"x", "shape"}, {"y"});
  EXPECT_NE(zero.refusal().find("the_Div"), std::string::npos) << zero.refusal();
}

}  // namespace
}  // namespace takt::onnx_engine
