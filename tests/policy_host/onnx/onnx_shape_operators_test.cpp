// SPDX-License-Identifier: Apache-2.0
// Goal: the operators that rename shapes or move elements, on floats at run time and on integers at load, including the
// forms that older opsets use. Method: elements numbered from 1, so that every result reads as a permutation.
#include <limits>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

const std::vector<float> counted{1, 2, 3, 4, 5, 6};
constexpr std::int64_t far = std::numeric_limits<std::int64_t>::max();

// One node on x [2, 3] = [[1 2 3] [4 5 6]] with integer inputs behind it.
Result on_matrix(const std::string& op, const std::vector<Dims>& parameters, std::int64_t opset = 13) {
  GraphMaker maker(opset);
  maker.input("x", {2, 3}).output("y");
  std::vector<std::string> inputs{"x"};
  for (const Dims& parameter : parameters) {
    inputs.push_back("p" + std::to_string(inputs.size()));
    maker.integers(inputs.back(), {static_cast<std::int64_t>(parameter.size())}, parameter);
  }
  maker.node(op, inputs, {"y"});
  return evaluate(maker, {counted});
}

TEST(Reshape, KeepsInfersAndFlattens) {
  EXPECT_EQ(on_matrix("Reshape", {{3, 2}}), (Result{{3, 2}, counted}));
  EXPECT_EQ(on_matrix("Reshape", {{0, -1}}), (Result{{2, 3}, counted}));
  EXPECT_EQ(on_matrix("Reshape", {{-1}}), (Result{{6}, counted}));
  EXPECT_EQ(on_matrix("Reshape", {{1, 0, -1}}), (Result{{1, 3, 2}, counted}));
}

TEST(Flatten, SplitsAtItsAxis) {
  for (const auto& [axis, shape] : {std::pair<std::int64_t, Dims>{0, {1, 6}}, {1, {2, 3}}, {2, {6, 1}}, {-1, {2, 3}}}) {
    GraphMaker maker;
    maker.input("x", {2, 3}).output("y").node("Flatten", {"x"}, {"y"}).with("axis", axis);
    EXPECT_EQ(evaluate(maker, {counted}), (Result{shape, counted}));
  }
}

TEST(SqueezeAndUnsqueeze, AxesAsInputsAndAsAttributes) {
  EXPECT_EQ(on_matrix("Unsqueeze", {{0, -1}}), (Result{{1, 2, 3, 1}, counted}));
  for (const std::int64_t opset : {11, 13}) {
    GraphMaker maker(opset);
    maker.input("x", {1, 6, 1}).output("y").integers("axes", {1}, {0});
    if (opset < 13) {
      maker.node("Squeeze", {"x"}, {"y"}).with("axes", Dims{0});
    } else {
      maker.node("Squeeze", {"x", "axes"}, {"y"});
    }
    EXPECT_EQ(evaluate(maker, {counted}), (Result{{6, 1}, counted}));
  }
  GraphMaker all;
  all.input("x", {1, 6, 1}).output("y").node("Squeeze", {"x"}, {"y"});
  EXPECT_EQ(evaluate(all, {counted}), (Result{{6}, counted}));
}

TEST(Identity, AnOutputThatIsAnInputKeepsTheLatestRun) {
  GraphMaker maker;
  maker.input("x", {1}).output("y").node("Identity", {"x"}, {"y"});
  auto model = maker.load();
  ASSERT_TRUE(model) << model.error();
  model->input(0)[0] = 1.0F;
  model->run();
  model->input(0)[0] = 2.0F;
  EXPECT_EQ(model->output(0)[0], 1.0F);
}

TEST(Transpose, ReversesOrPermutes) {
  EXPECT_EQ(on_matrix("Transpose", {}), (Result{{3, 2}, {1, 4, 2, 5, 3, 6}}));
  GraphMaker maker;
  maker.input("x", {1, 2, 3}).output("y").node("Transpose", {"x"}, {"y"}).with("perm", Dims{1, 2, 0});
  EXPECT_EQ(evaluate(maker, {counted}), (Result{{2, 3, 1}, counted}));
}

TEST(Slice, StartsEndsAxesAndSteps) {
  EXPECT_EQ(on_matrix("Slice", {{1}, {2}}), (Result{{1, 3}, {4, 5, 6}}));
  EXPECT_EQ(on_matrix("Slice", {{1}, {far}, {1}}), (Result{{2, 2}, {2, 3, 5, 6}}));
  EXPECT_EQ(on_matrix("Slice", {{-2}, {-1}, {-1}}), (Result{{2, 1}, {2, 5}}));
  EXPECT_EQ(on_matrix("Slice", {{0}, {3}, {1}, {2}}), (Result{{2, 2}, {1, 3, 4, 6}}));
  EXPECT_EQ(on_matrix("Slice", {{-1}, {-far}, {1}, {-1}}), (Result{{2, 3}, {3, 2, 1, 6, 5, 4}}));
  EXPECT_EQ(on_matrix("Slice", {{-far}, {far}, {1}, {far}}), (Result{{2, 1}, {1, 4}}));
}

TEST(Slice, AttributesBeforeOpset10) {
  GraphMaker maker(9);
  maker.input("x", {2, 3}).output("y");
  maker.node("Slice", {"x"}, {"y"}).with("starts", Dims{0, 1}).with("ends", Dims{1, 3}).with("axes", Dims{0, 1});
  EXPECT_EQ(evaluate(maker, {counted}), (Result{{1, 2}, {2, 3}}));
}

TEST(Gather, PicksRowsColumnsAndSingles) {
  for (const auto& [axis, dims, indices, expected] :
       {std::tuple<std::int64_t, Dims, Dims, Result>{0, {2}, {1, 0}, {{2, 3}, {4, 5, 6, 1, 2, 3}}},
        {1, {2}, {-1, 0}, {{2, 2}, {3, 1, 6, 4}}},
        {1, {}, {1}, {{2}, {2, 5}}},
        {1, {2, 1}, {0, 2}, {{2, 2, 1}, {1, 3, 4, 6}}}}) {
    GraphMaker maker;
    maker.input("x", {2, 3}).output("y").integers("i", dims, indices);
    maker.node("Gather", {"x", "i"}, {"y"}).with("axis", axis);
    EXPECT_EQ(evaluate(maker, {counted}), expected);
  }
}

TEST(Gather, RefusesAnIndexOutsideItsAxis) {
  GraphMaker maker;
  maker.input("x", {2, 3}).output("y").integers("i", {1}, {2}).node("Gather", {"x", "i"}, {"y"});
  EXPECT_NE(maker.refusal().find("index 2 is outside"), std::string::npos) << maker.refusal();
}

TEST(Expand, RepeatsWhereADimensionIsOneOrMissing) {
  GraphMaker maker;
  maker.input("x", {2, 1}).output("y").integers("shape", {3}, {2, 1, 3}).node("Expand", {"x", "shape"}, {"y"});
  EXPECT_EQ(evaluate(maker, {{1, 2}}), (Result{{2, 2, 3}, {1, 1, 1, 2, 2, 2, 1, 1, 1, 2, 2, 2}}));
}

TEST(Concat, AlongEachAxisOfInputsAndConstants) {
  for (const auto& [axis, dims, expected] :
       {std::tuple<std::int64_t, Dims, Result>{0, {1, 3}, {{3, 3}, {1, 2, 3, 4, 5, 6, 7, 8, 9}}},
        {-1, {2, 1}, {{2, 4}, {1, 2, 3, 7, 4, 5, 6, 8}}}}) {
    GraphMaker maker;
    maker.input("x", {2, 3}).output("y");
    maker.floats("c", dims, axis == 0 ? std::vector<float>{7, 8, 9} : std::vector<float>{7, 8});
    maker.node("Concat", {"x", "c"}, {"y"}).with("axis", axis);
    EXPECT_EQ(evaluate(maker, {counted}), expected);
  }
}

TEST(Constant, TensorsNumbersAndIntegers) {
  GraphMaker maker;
  maker.input("x", {1}).output("y");
  maker.node("Constant", {}, {"a"}).with("value", float_tensor("", {1}, {1}));
  maker.node("Constant", {}, {"b"}).with("value_float", 20.0F);
  maker.node("Constant", {}, {"c"}).with("value_floats", std::vector<float>{300});
  maker.node("Constant", {}, {"i"}).with("value_int", std::int64_t{4000});
  maker.node("Constant", {}, {"shape"}).with("value_ints", Dims{1, 1});
  maker.node("Cast", {"i"}, {"d"}).with("to", std::int64_t{onnx::TensorProto_DataType_FLOAT});
  maker.node("Add", {"a", "b"}, {"ab"});
  maker.node("Add", {"c", "d"}, {"cd"});
  maker.node("Add", {"ab", "cd"}, {"abcd"});
  maker.node("Add", {"x", "abcd"}, {"sum"});
  maker.node("Reshape", {"sum", "shape"}, {"y"});
  EXPECT_EQ(evaluate(maker, {{50000}}), (Result{{1, 1}, {54321}}));
}

// The chain by which exporters keep a batch dimension open: x.view(x.shape[0], -1), with zeros and a cast beside it.
TEST(ShapeArithmetic, VanishesAtLoad) {
  GraphMaker maker(13);
  maker.input("x", {2, 3}).output("y").integers("zero", {}, {0}).integers("axis", {1}, {0}).integers("rest", {1}, {-1});
  maker.node("Shape", {"x"}, {"shape"});
  maker.node("Gather", {"shape", "zero"}, {"rows"});
  maker.node("Unsqueeze", {"rows", "axis"}, {"rows1"});
  maker.node("Cast", {"rows1"}, {"rows_float"}).with("to", std::int64_t{onnx::TensorProto_DataType_FLOAT});
  maker.node("Cast", {"rows_float"}, {"rows2"}).with("to", std::int64_t{onnx::TensorProto_DataType_INT64});
  maker.node("Concat", {"rest", "rows2"}, {"target"}).with("axis", std::int64_t{0});
  maker.node("Reshape", {"x", "target"}, {"view"});
  maker.node("ConstantOfShape", {"target_known"}, {"ones"}).with("value", float_tensor("", {1}, {1}));
  maker.node("Add", {"view", "ones"}, {"y"});
  maker.integers("target_known", {2}, {3, 2});
  EXPECT_EQ(evaluate(maker, {counted}), (Result{{3, 2}, {2, 3, 4, 5, 6, 7}}));
}

}  // namespace
}  // namespace takt::onnx_engine
