// SPDX-License-Identifier: Apache-2.0
// Goal: means, softmax and layer normalisation over the right axes, under the rules of old and new opsets.
// Method: rows whose results are short numbers, worked out beside them.
#include <cmath>
#include <limits>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

const std::vector<float> counted{1, 2, 3, 4, 5, 6};

Result mean(const Dims& axes, std::int64_t keep) {
  GraphMaker maker;
  maker.input("x", {2, 3}).output("y").node("ReduceMean", {"x"}, {"y"}).with("axes", axes).with("keepdims", keep);
  return evaluate(maker, {counted});
}

TEST(ReduceMean, OverOneAxisOrSeveral) {
  EXPECT_EQ(mean({1}, 1), (Result{{2, 1}, {2, 5}}));            // (1+2+3)/3, (4+5+6)/3
  EXPECT_EQ(mean({-2}, 0), (Result{{3}, {2.5F, 3.5F, 4.5F}}));  // (1+4)/2, (2+5)/2, (3+6)/2
  EXPECT_EQ(mean({0, 1}, 0), (Result{{}, {3.5F}}));             // 21/6
}

TEST(ReduceMean, OverEverythingWithoutAxes) {
  GraphMaker maker;
  maker.input("x", {2, 3}).output("y").node("ReduceMean", {"x"}, {"y"});
  EXPECT_EQ(evaluate(maker, {counted}), (Result{{1, 1}, {3.5F}}));
}

// e^0 : e^ln3 = 1 : 3
const float ln3 = std::log(3.0F);

TEST(Softmax, AlongTheLastAxisSinceOpset13) {
  GraphMaker maker(13);
  maker.input("x", {2, 1, 2}).output("y").node("Softmax", {"x"}, {"y"});
  expect_near(evaluate(maker, {{0, ln3, 5, 5}}), {2, 1, 2}, {0.25F, 0.75F, 0.5F, 0.5F});
}

TEST(Softmax, AlongAMiddleAxis) {
  GraphMaker maker(13);
  maker.input("x", {1, 2, 2}).output("y").node("Softmax", {"x"}, {"y"}).with("axis", std::int64_t{1});
  // columns (0, ln 3) and (5, 5)
  expect_near(evaluate(maker, {{0, 5, ln3, 5}}), {1, 2, 2}, {0.25F, 0.5F, 0.75F, 0.5F});
}

TEST(Softmax, EverythingFromAxisOneOnBeforeOpset13) {
  GraphMaker maker(11);
  maker.input("x", {1, 2, 2}).output("y").node("Softmax", {"x"}, {"y"});
  // one row: e^0, e^0, e^ln3, e^ln3 = 1, 1, 3, 3 of 8
  expect_near(evaluate(maker, {{0, 0, ln3, ln3}}), {1, 2, 2}, {0.125F, 0.125F, 0.375F, 0.375F});
}

TEST(Softmax, LargeNumbersDoNotOverflowAndNotANumberShows) {
  GraphMaker maker(13);
  maker.input("x", {1, 2}).output("y").node("Softmax", {"x"}, {"y"});
  expect_near(evaluate(maker, {{1000, 1000}}), {1, 2}, {0.5F, 0.5F});
  for (const float y : evaluate(maker, {{std::numeric_limits<float>::quiet_NaN(), 0}}).values)
    EXPECT_TRUE(std::isnan(y));
}

GraphMaker layer_norm(bool bias) {
  GraphMaker maker(17);
  maker.input("x", {2, 2}).output("y").floats("scale", {2}, {1, 10}).floats("bias", {2}, {100, 200});
  maker.node("LayerNormalization", {"x", "scale", bias ? "bias" : ""}, {"y"}).with("epsilon", 0.0F);
  return maker;
}

TEST(LayerNormalization, CentresScalesAndShiftsEachRow) {
  // (1, 3): mean 2, deviation 1 -> (-1, 1); (10, 6): mean 8, deviation 2 -> (1, -1)
  expect_near(evaluate(layer_norm(false), {{1, 3, 10, 6}}), {2, 2}, {-1, 10, 1, -10});
  expect_near(evaluate(layer_norm(true), {{1, 3, 10, 6}}), {2, 2}, {99, 210, 101, 190});
}

TEST(LayerNormalization, EpsilonKeepsAConstantRowFinite) {
  GraphMaker maker(17);
  maker.input("x", {1, 2}).output("y").floats("scale", {2}, {1, 1});
  maker.node("LayerNormalization", {"x", "scale"}, {"y"});
  EXPECT_EQ(evaluate(maker, {{4, 4}}), (Result{{1, 2}, {0, 0}}));
}

}  // namespace
}  // namespace takt::onnx_engine
