// SPDX-License-Identifier: Apache-2.0
// Goal: a recurrent network that has lost its memory is told by its graph alone, for engines that run what the built-in
// one cannot load. Method: one recurrent node between operators that the built-in engine knows and does not know, its
// start state from everywhere that exporters take it from.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::onnx_engine {
namespace {

constexpr std::int64_t kHidden = 4;

class MemoryTest : public testing::Test {
 protected:
  // x, `shape`, through `op` with the start state `state` ("": none).
  GraphMaker recurrent(const Dims& shape, const std::string& state, const std::string& op = "LSTM") {
    GraphMaker maker(14);
    const std::int64_t gates = op == "LSTM" ? 4 : op == "GRU" ? 3 : 1;
    maker.input("x", shape).output("y");
    maker.floats("w", {1, gates * kHidden, 2}, std::vector<float>(static_cast<std::size_t>(gates * kHidden * 2), 0.1F));
    maker.floats("r", {1, gates * kHidden, kHidden},
                 std::vector<float>(static_cast<std::size_t>(gates * kHidden * kHidden), 0.1F));
    maker.floats("zeros", {1, 1, kHidden}, std::vector<float>(static_cast<std::size_t>(kHidden)));
    maker.integers("size", {3}, {1, 1, kHidden});
    maker.node("HardSwish", {"x"}, {"before"});
    if (state == "filled") maker.node("ConstantOfShape", {"size"}, {"filled"});
    if (state == "of x's shape") {
      maker.node("Shape", {"x"}, {"shape"});
      maker.node("ConstantOfShape", {"shape"}, {"of x's shape"});
    }
    std::vector<std::string> inputs{"before", "w", "r"};
    if (!state.empty()) inputs.insert(inputs.end(), {"", "", state});
    maker.node(op, inputs, {"y"}).with("hidden_size", kHidden);
    return maker;
  }
  Memory memory_of(const GraphMaker& maker) {
    std::ofstream(file_, std::ios::binary) << maker.model.SerializeAsString();
    const auto memory = read_memory(file_);
    EXPECT_TRUE(memory) << memory.error();
    return memory.value_or(Memory{});
  }
  void TearDown() override { std::filesystem::remove(file_); }

  const std::filesystem::path file_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("takt_memory_") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".onnx");
};

TEST_F(MemoryTest, OneStepFromAStateThatNoInputDecidesIsLost) {
  for (const char* const op : {"LSTM", "GRU", "RNN"})
    for (const char* const state : {"", "zeros", "filled", "of x's shape"}) {
      const Memory memory = memory_of(recurrent({1, 1, 2}, state, op));
      EXPECT_EQ(memory.lost, std::vector<std::string>{std::string(op) + " node 'the_" + op + "'"}) << op << state;
      EXPECT_TRUE(memory.unclear.empty());
    }
}

TEST_F(MemoryTest, AStateThatIsHandedInIsKept) {
  GraphMaker maker = recurrent({1, 1, 2}, "h_in");
  maker.input("h_in", {1, 1, kHidden});
  EXPECT_TRUE(memory_of(maker).lost.empty());
  maker.graph().mutable_node(1)->set_input(5, "scaled");
  maker.node("HardSwish", {"h_in"}, {"scaled"});
  maker.graph().mutable_node()->SwapElements(1, 2);
  EXPECT_TRUE(memory_of(maker).lost.empty());
}

TEST_F(MemoryTest, SeveralStepsAreAHistory) {
  const Memory memory = memory_of(recurrent({5, 1, 2}, ""));
  EXPECT_TRUE(memory.lost.empty());
  EXPECT_TRUE(memory.unclear.empty());
}

TEST_F(MemoryTest, ABatchThatIsOpenIsOne) {
  GraphMaker maker = recurrent({1, 1, 2}, "");
  maker.graph().mutable_input(0)->mutable_type()->mutable_tensor_type()->mutable_shape()->mutable_dim(0)->set_dim_param(
      "batch");
  EXPECT_EQ(memory_of(maker).lost.size(), 1U);
}

TEST_F(MemoryTest, WhatNobodyCanInferIsUnclear) {
  GraphMaker maker = recurrent({1, 1, 2}, "");
  maker.graph().mutable_node(0)->set_op_type("Unheard");
  const Memory memory = memory_of(maker);
  EXPECT_TRUE(memory.lost.empty());
  EXPECT_EQ(memory.unclear.size(), 1U);
}

TEST_F(MemoryTest, InABranchItIsUnclear) {
  GraphMaker inner = recurrent({1, 1, 2}, ""), maker(14);
  maker.input("x", {1, 1, 2}).output("y");
  inner.graph().clear_input();
  maker.node("If", {"truth"}, {"y"}).with("then_branch", inner.graph()).with("else_branch", inner.graph());
  EXPECT_EQ(memory_of(maker).unclear.size(), 2U);
}

}  // namespace
}  // namespace takt::onnx_engine
