// SPDX-License-Identifier: Apache-2.0
// Goal: each function of one element has the right value, over its whole range, and lets "not a number" through.
// Method: one-node models against the C library in double precision.
#include <cmath>
#include <limits>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

struct Case {
  std::string op;
  double (*expected)(double);
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.op;
}

class Activation : public testing::TestWithParam<Case> {};

GraphMaker one_node(const std::string& op, std::int64_t count) {
  GraphMaker maker;
  maker.input("x", {count}).output("y").node(op, {"x"}, {"y"});
  return maker;
}

TEST_P(Activation, MatchesTheMathematicsOverItsRange) {
  std::vector<float> x;
  for (float v = -30.0F; v <= 30.0F; v += 0.0137F) x.push_back(GetParam().op == "Sqrt" ? std::abs(v) : v);
  const Result y = evaluate(one_node(GetParam().op, static_cast<std::int64_t>(x.size())), {x});
  ASSERT_EQ(y.values.size(), x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double expected = GetParam().expected(static_cast<double>(x[i]));
    EXPECT_NEAR(y.values[i], expected, 4e-7 * std::max(1.0, std::abs(expected))) << "x = " << x[i];
  }
}

TEST_P(Activation, LetsNotANumberThroughAtEveryPlace) {
  for (std::size_t bad = 0; bad < 19; ++bad) {  // two whole registers of eight and a remainder
    std::vector<float> x(19, 0.5F);
    x[bad] = nan;
    const Result y = evaluate(one_node(GetParam().op, 19), {x});
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(std::isnan(y.values[i]), i == bad) << "at " << i;
  }
}

// The promise of equal bits rests on this: where an element lies must not matter.
TEST_P(Activation, AnElementsBitsDoNotDependOnItsPlace) {
  for (const float value : {0.7F, 0.1F, 3.3F}) {
    const Result y = evaluate(one_node(GetParam().op, 21), {std::vector<float>(21, value)});
    for (const float element : y.values) EXPECT_EQ(element, y.values[0]);
  }
}

INSTANTIATE_TEST_SUITE_P(Operators, Activation,
                         testing::Values(Case{"Sqrt", [](double x) { return std::sqrt(x); }},
                                         Case{"Relu", [](double x) { return std::max(x, 0.0); }},
                                         Case{"LeakyRelu", [](double x) { return x < 0.0 ? 0.01 * x : x; }},
                                         Case{"Elu", [](double x) { return x < 0.0 ? std::expm1(x) : x; }},
                                         Case{"Tanh", [](double x) { return std::tanh(x); }},
                                         Case{"Sigmoid", [](double x) { return 1.0 / (1.0 + std::exp(-x)); }},
                                         Case{"Erf", [](double x) { return std::erf(x); }}),
                         [](const testing::TestParamInfo<Case>& one) { return one.param.op; });

TEST(Activations, HoldAtInfinity) {
  const std::vector<float> x{-infinity, infinity, -200.0F, 200.0F};
  EXPECT_EQ(evaluate(one_node("Tanh", 4), {x}).values, (std::vector<float>{-1, 1, -1, 1}));
  EXPECT_EQ(evaluate(one_node("Elu", 4), {x}).values, (std::vector<float>{-1, infinity, -1, 200}));
  expect_near(evaluate(one_node("Sigmoid", 4), {x}), {4}, {0, 1, 0, 1});
}

TEST(Activations, AlphaScalesTheNegativeSide) {
  GraphMaker maker;
  maker.input("x", {2}).output("y").node("Elu", {"x"}, {"y"}).with("alpha", 2.0F);
  expect_near(evaluate(maker, {{-1.0F, 3.0F}}), {2}, {2.0F * (std::exp(-1.0F) - 1.0F), 3.0F});
}

TEST(Activations, ClipTakesItsBoundsAsInputsOrAttributes) {
  GraphMaker inputs(13);
  inputs.input("x", {3}).output("y").floats("low", {}, {-1}).floats("high", {}, {2});
  inputs.node("Clip", {"x", "low", "high"}, {"y"});
  EXPECT_EQ(evaluate(inputs, {{-5, 0.5F, 5}}).values, (std::vector<float>{-1, 0.5F, 2}));

  GraphMaker attributes(9);
  attributes.input("x", {3}).output("y").node("Clip", {"x"}, {"y"}).with("max", 2.0F);
  EXPECT_EQ(evaluate(attributes, {{-5, 0.5F, 5}}).values, (std::vector<float>{-5, 0.5F, 2}));
}

}  // namespace
}  // namespace takt::onnx_engine
