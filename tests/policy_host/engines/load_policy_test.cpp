// SPDX-License-Identifier: Apache-2.0
// Goal: what is beyond the built-in engine, `auto` gives to ONNX Runtime, and both reasons are said where that cannot
// either; what is wrong with the file itself, no other engine takes silently: memory that goes nowhere, weights that
// the policy's hash does not cover, damage. Method: networks of the demo arm's shapes, run by its robot file with one
// engine after the other.
#include "policy_host/engines/load_policy.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "tests/policy_host/demo_arm_networks.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

class LoadPolicy : public testing::Test {
 protected:
  using Loaded = std::expected<std::unique_ptr<Policy>, std::string>;

  Loaded load(const onnx_engine::GraphMaker& maker, const std::string& engine) {
    write(maker, file_);
    auto robot = config::load("config/arm6.yaml");
    if (!robot) return std::unexpected(robot.error());
    robot->policy->file = file_;
    robot->policy->engine.emplace();
    robot->policy->engine->name = engine;
    if (!engine.contains('/')) robot->policy->engine->library = library_;
    return load_policy(*robot);
  }
  void expect_lost(const Loaded& policy) const {
    ASSERT_FALSE(policy) << "a recurrent policy without its state was accepted";
    EXPECT_EQ(policy.error(), file_ +
                                  ": LSTM node 'the_LSTM' begins every inference from the same state, so its memory is "
                                  "lost between observations; export the network with its state as inputs <x>_in and "
                                  "outputs <x>_out");
  }

  test::TemporaryDirectory directory_;
  const std::string file_ = directory_.path("policy.onnx");
  const std::optional<std::filesystem::path> runtime_ = installed_onnx_runtime();
  std::string library_ = runtime_ ? std::filesystem::absolute(*runtime_).string() : "";
};

std::vector<float> answer_of(Policy& policy) {
  std::vector<float> observation = some_weights(policy.input_size()), answer(policy.output_size());
  policy.infer(observation, answer);
  return answer;
}

class ByOnnxRuntime : public LoadPolicy {
 protected:
  void SetUp() override {
    if (!runtime_) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
  }
};

TEST_F(ByOnnxRuntime, AMemoryThatGoesNowhereIsRefused) {
  const auto large = forgetful(512);
  const auto model = large.load();
  ASSERT_TRUE(model && is_quicker_elsewhere(*model));
  expect_lost(load(large, "auto"));
  expect_lost(load(large, "onnxruntime"));
  expect_lost(load(forgetful(8), "onnxruntime"));
  expect_lost(load(forgetful(8), "builtin"));
}

TEST_F(LoadPolicy, APluginOfSomebodyElsesIsNoWayAroundIt) {
  expect_lost(load(forgetful(8), TAKT_ODD_ENGINE_FILE));
  auto outside = beyond_the_built_in_engine();
  keep_outside(*outside.graph().mutable_initializer(0), "weights.bin", directory_.path("weights.bin"));
  const auto policy = load(outside, TAKT_ODD_ENGINE_FILE);
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("which the policy's hash covers"), std::string::npos) << policy.error();
}

// An operator, a way of calling one, a type, an opset that the built-in engine lacks.
std::vector<onnx_engine::GraphMaker> beyond() {
  std::vector<onnx_engine::GraphMaker> makers{beyond_the_built_in_engine()};
  auto& clip = makers.emplace_back(demo_arm_network());
  clip.floats("w", {24, 96}, some_weights(std::size_t{24} * 96));
  clip.node("MatMul", {"obs", "w"}, {"h"});
  clip.node("ReduceMean", {"obs"}, {"low"}).with("keepdims", std::int64_t{0});
  clip.node("Clip", {"h", "low"}, {"actions"});
  auto& as_half = makers.emplace_back(demo_arm_network());
  as_half.floats("w", {24, 96}, some_weights(std::size_t{24} * 96));
  as_half.node("MatMul", {"obs", "w"}, {"h"});
  as_half.node("Cast", {"h"}, {"exact"}).with("to", std::int64_t{onnx::TensorProto_DataType_FLOAT16});
  as_half.node("Cast", {"exact"}, {"actions"}).with("to", std::int64_t{onnx::TensorProto_DataType_FLOAT});
  as_half.graph().mutable_node(2)->set_name("back");
  makers.emplace_back(beyond_the_built_in_engine()).graph().mutable_node(1)->set_op_type("Elu");
  makers.back().model.mutable_opset_import(0)->set_version(22);
  makers.back().model.set_ir_version(10);
  return makers;
}

TEST_F(ByOnnxRuntime, WhatIsBeyondTheBuiltInEngineRunsThere) {
  for (const onnx_engine::GraphMaker& maker : beyond()) {
    SCOPED_TRACE(maker.model.graph().node().rbegin()->op_type());
    EXPECT_FALSE(load(maker, "builtin"));
    const auto by_auto = load(maker, "auto");
    ASSERT_TRUE(by_auto) << by_auto.error();
    EXPECT_TRUE((*by_auto)->description().starts_with("ONNX Runtime ")) << (*by_auto)->description();
    EXPECT_TRUE((*by_auto)->description().ends_with(", cpu, 1 thread")) << (*by_auto)->description();
    const auto by_name = load(maker, "onnxruntime");
    ASSERT_TRUE(by_name) << by_name.error();
    EXPECT_EQ(answer_of(**by_auto), answer_of(**by_name));
    const auto choice = choose_engine(file_);
    ASSERT_TRUE(choice) << choice.error();
    EXPECT_EQ(choice->name, "onnxruntime");
    EXPECT_FALSE(choice->why.empty());
  }
}

TEST_F(LoadPolicy, WhereOnnxRuntimeIsNotThereBothReasonsAreInOneLine) {
  library_ = "/nowhere/libonnxruntime.so";
  const auto refused = load(beyond_the_built_in_engine(), "auto");
  ASSERT_FALSE(refused);
  EXPECT_TRUE(refused.error().starts_with(
      file_ +
      ": LpNormalization node 'the_LpNormalization' is not supported (by the built-in engine); nor does it run in ONNX "
      "Runtime: /nowhere/libonnxruntime.so: cannot be loaded"))
      << refused.error();
  EXPECT_EQ(refused.error().find('\n'), std::string::npos);
}

// What is beyond the engine does not hide what is wrong.
TEST_F(ByOnnxRuntime, BeyondTheBuiltInEngineTooMemoryThatGoesNowhereIsRefused) {
  auto lost = forgetful(8);
  onnx::NodeProto& last = *lost.graph().mutable_node(lost.graph().node_size() - 1);
  last.set_output(0, "plain");
  lost.node("LpNormalization", {"plain"}, {"actions"});
  expect_lost(load(lost, "auto"));
  expect_lost(load(lost, "onnxruntime"));
  expect_lost(load(lost, TAKT_ODD_ENGINE_FILE));
}

TEST_F(ByOnnxRuntime, WhatIsWrongWithTheFileIsNotHandedOver) {
  auto cut_short = beyond_the_built_in_engine();
  cut_short.graph().mutable_node(1)->set_op_type("Elu");
  cut_short.graph().mutable_initializer(0)->mutable_float_data()->RemoveLast();
  auto misfit = beyond_the_built_in_engine();
  misfit.graph().mutable_node(1)->set_op_type("Elu");
  misfit.graph().mutable_initializer(0)->set_dims(0, 96);
  misfit.graph().mutable_initializer(0)->set_dims(1, 24);
  auto nameless = beyond_the_built_in_engine();
  nameless.graph().mutable_node(1)->set_op_type("Elu");
  nameless.graph().mutable_node(1)->set_input(0, "nobody's");
  for (const auto* const maker : {&cut_short, &misfit, &nameless}) {
    const auto refused = load(*maker, "auto");
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().find("ONNX Runtime"), std::string::npos) << refused.error();
    EXPECT_FALSE(choose_engine(file_));
  }
}

// The reshape's target is chosen when it runs, so that it is unknown how many steps the LSTM takes.
TEST_F(ByOnnxRuntime, WhereItCannotBeToldWhetherMemoryIsLostTheLogSaysSo) {
  auto maker = forgetful(8);
  onnx::TensorProto truth;
  truth.set_name("truth");
  truth.set_data_type(onnx::TensorProto_DataType_BOOL);
  truth.add_dims(1);
  truth.add_int32_data(1);
  *maker.graph().add_initializer() = truth;
  maker.node("Where", {"truth", "one", "one"}, {"target"});
  maker.graph().mutable_node(0)->set_input(1, "target");
  maker.graph().mutable_node()->SwapElements(0, maker.graph().node_size() - 1);  // sources stand before their users
  for (int i = maker.graph().node_size() - 1; i > 1; --i) maker.graph().mutable_node()->SwapElements(i, i - 1);
  onnx::NodeProto& last = *maker.graph().mutable_node(maker.graph().node_size() - 1);
  last.set_output(0, "plain");
  maker.node("LpNormalization", {"plain"}, {"actions"});
  const auto unclear = load(maker, "auto");
  ASSERT_TRUE(unclear) << unclear.error();
  EXPECT_TRUE((*unclear)->description().ends_with(
      ", cpu, 1 thread; whether LSTM node 'the_LSTM' keeps its memory was not found out"))
      << (*unclear)->description();
}

TEST_F(ByOnnxRuntime, WeightsThatThePolicysHashDoesNotCoverAreRefused) {
  auto outside = beyond_the_built_in_engine();
  keep_outside(*outside.graph().mutable_initializer(0), "weights.bin", directory_.path("weights.bin"));
  for (const char* const engine : {"auto", "onnxruntime"}) {
    const auto refused = load(outside, engine);
    ASSERT_FALSE(refused) << "weights that can be exchanged under the policy's name were accepted";
    EXPECT_NE(
        refused.error().find(" keeps its data in 'weights.bin'; only policy.onnx.data or policy.onnx_data beside "
                             "the model is read, which the policy's hash covers: export it under that name, or as "
                             "one file"),
        std::string::npos)
        << refused.error();
  }
  auto covered = beyond_the_built_in_engine();
  keep_outside(*covered.graph().mutable_initializer(0), "policy.onnx.data", file_ + ".data");
  const auto policy = load(covered, "onnxruntime");
  ASSERT_TRUE(policy) << policy.error();
  // The hash says which weights they were.
  const auto before = config::policy_hash(file_);
  std::ofstream(file_ + ".data", std::ios::binary | std::ios::app) << "more";
  EXPECT_NE(before, config::policy_hash(file_));
}

}  // namespace
}  // namespace takt::policy_host
