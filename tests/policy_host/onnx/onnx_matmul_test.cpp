// SPDX-License-Identifier: Apache-2.0
// Goal: Gemm and MatMul in all their variants, and bits that do not depend on how a product is tiled.
// Method: products small enough to check by hand; random sizes around the tile edges against a plain triple loop.
#include <cmath>
#include <random>

#include "policy_host/onnx_engine/panels.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

// a = [[1 2 3] [4 5 6]], b = [[1 0] [0 1] [1 1]]: a b = [[4 5] [10 11]]
const std::vector<float> a{1, 2, 3, 4, 5, 6};
const std::vector<float> a_transposed{1, 4, 2, 5, 3, 6};
const std::vector<float> b{1, 0, 0, 1, 1, 1};
const std::vector<float> b_transposed{1, 0, 1, 0, 1, 1};

TEST(Gemm, PlainWithoutC) {
  GraphMaker maker;
  maker.input("a", {2, 3}).output("y").floats("b", {3, 2}, b).node("Gemm", {"a", "b"}, {"y"});
  EXPECT_EQ(evaluate(maker, {a}), (Result{{2, 2}, {4, 5, 10, 11}}));
}

TEST(Gemm, TransposesScalesAndAddsARow) {
  // 2 a b + 10 [1 2] = [[8 10] [20 22]] + [10 20]
  GraphMaker maker;
  maker.input("a", {3, 2}).output("y").floats("b", {2, 3}, b_transposed).floats("c", {2}, {1, 2});
  maker.node("Gemm", {"a", "b", "c"}, {"y"})
      .with("transA", std::int64_t{1})
      .with("transB", std::int64_t{1})
      .with("alpha", 2.0F)
      .with("beta", 10.0F);
  EXPECT_EQ(evaluate(maker, {a_transposed}), (Result{{2, 2}, {18, 30, 30, 42}}));
}

TEST(Gemm, CMayBeAColumnAScalarOrAnInput) {
  for (const auto& [shape, c, expected] :
       {std::tuple<Dims, std::vector<float>, std::vector<float>>{{2, 1}, {100, 200}, {104, 105, 210, 211}},
        {{}, {1}, {5, 6, 11, 12}},
        {{2, 2}, {1, 2, 3, 4}, {5, 7, 13, 15}}}) {
    GraphMaker maker;
    maker.input("a", {2, 3}).input("c", shape).output("y").floats("b", {3, 2}, b).node("Gemm", {"a", "b", "c"}, {"y"});
    EXPECT_EQ(evaluate(maker, {a, c}), (Result{{2, 2}, expected}));
  }
}

TEST(Gemm, BothFactorsMayBeInputs) {
  GraphMaker maker;
  maker.input("a", {2, 3}).input("b", {2, 3}).output("y");
  maker.node("Gemm", {"a", "b"}, {"y"}).with("transB", std::int64_t{1});
  EXPECT_EQ(evaluate(maker, {a, b_transposed}), (Result{{2, 2}, {4, 5, 10, 11}}));
}

Result product(const Dims& a_shape, const std::vector<float>& left, const Dims& b_shape,
               const std::vector<float>& right, bool constant) {
  GraphMaker maker;
  maker.input("a", a_shape).output("y");
  if (constant) {
    maker.floats("b", b_shape, right);
  } else {
    maker.input("b", b_shape);
  }
  maker.node("MatMul", {"a", "b"}, {"y"});
  return constant ? evaluate(maker, {left}) : evaluate(maker, {left, right});
}

TEST(MatMul, MatricesVectorsAndStacks) {
  for (const bool constant : {true, false}) {
    EXPECT_EQ(product({2, 3}, a, {3, 2}, b, constant), (Result{{2, 2}, {4, 5, 10, 11}}));
    EXPECT_EQ(product({3}, {1, 2, 3}, {3, 2}, b, constant), (Result{{2}, {4, 5}}));
    EXPECT_EQ(product({2, 3}, a, {3}, {1, 1, 1}, constant), (Result{{2}, {6, 15}}));
    EXPECT_EQ(product({3}, {1, 2, 3}, {3}, {1, 1, 1}, constant), (Result{{}, {6}}));
    // A stack on the left shares one matrix; a stack on the right reuses the left; stacks pair up and broadcast.
    EXPECT_EQ(product({2, 1, 3}, a, {3, 2}, b, constant), (Result{{2, 1, 2}, {4, 5, 10, 11}}));
    EXPECT_EQ(product({1, 3}, {1, 2, 3}, {2, 3, 1}, {1, 0, 1, 0, 1, 1}, constant), (Result{{2, 1, 1}, {4, 5}}));
    EXPECT_EQ(product({2, 1, 3}, a, {2, 3, 1}, {1, 0, 1, 0, 1, 1}, constant), (Result{{2, 1, 1}, {4, 11}}));
    EXPECT_EQ(product({2, 1, 1, 3}, a, {2, 3, 1}, {1, 0, 1, 0, 1, 1}, constant),
              (Result{{2, 2, 1, 1}, {4, 5, 10, 11}}));
  }
}

TEST(MatMul, RefusesFactorsThatDoNotFit) {
  GraphMaker maker;
  maker.input("a", {2, 3}).input("b", {2, 3}).output("y").node("MatMul", {"a", "b"}, {"y"});
  EXPECT_NE(maker.refusal(), "");
}

// Sizes around the panel (32 columns), the register (8) and the tile (4 rows). The reference adds in ascending k, one
// rounding per operation, so the comparison is exact.
TEST(Panels, EveryTilingAndRegisterWidthGivesTheBitsOfThePlainLoop) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  for (const std::size_t rows : {1U, 3U, 4U, 5U, 9U}) {
    for (const std::size_t columns : {1U, 7U, 8U, 31U, 32U, 33U, 64U, 100U}) {
      for (const std::size_t inner : {1U, 2U, 37U, 300U}) {
        std::vector<float> left(rows * inner);
        std::vector<float> right(inner * columns);
        for (float& x : left) x = number(random);
        for (float& x : right) x = number(random);
        std::vector<float> packed(packed_size(inner, columns));
        pack_panels(right.data(), inner, columns, columns, 1, packed.data());
        std::vector<float> plain;
        for (std::size_t i = 0; i < rows * columns; ++i) {
          float sum = 0.0F;
          for (std::size_t k = 0; k < inner; ++k) {
            const float term = left[i / columns * inner + k] * right[k * columns + i % columns];
            sum += term;
          }
          plain.push_back(sum);
        }
        plain.push_back(77.0F);  // behind the end
        for (const MultiplyPanels multiply : every_multiply_panels()) {
          std::vector<float> out(rows * columns + 1, 77.0F);
          multiply(left.data(), packed.data(), rows, inner, columns, out.data());
          ASSERT_EQ(out, plain) << rows << "x" << inner << "x" << columns;
        }
      }
    }
  }
}

}  // namespace
}  // namespace takt::onnx_engine
