// Goal: what the built-in engine refuses for a reason of the file's, no other engine takes silently: memory that goes
// nowhere, weights that the policy's hash does not cover; and where nobody looked, the log says so. Method: networks of
// the demo arm's shapes, run by its robot file with one engine after the other.
#include "policy_host/engines/load_policy.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "config/load.hpp"
#include "tests/policy_host/demo_arm_networks.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"

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
    if (runtime_ && !engine.contains('/')) robot->policy->engine->library = std::filesystem::absolute(*runtime_);
    return load_policy(*robot);
  }
  void expect_lost(const Loaded& policy) const {
    ASSERT_FALSE(policy) << "a recurrent policy without its state was accepted";
    EXPECT_EQ(policy.error(), file_ +
                                  ": LSTM node 'the_LSTM' begins every inference from the same state, so its memory is "
                                  "lost between observations; export the network with its state as inputs <x>_in and "
                                  "outputs <x>_out");
  }

  TemporaryDirectory directory_;
  const std::string file_ = directory_.path("policy.onnx");
  const std::optional<std::filesystem::path> runtime_ = installed_onnx_runtime();
};

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

TEST_F(ByOnnxRuntime, WhereNobodyLookedForMemoryTheLogSaysSo) {
  const auto beyond = load(beyond_the_built_in_engine(), "onnxruntime");
  ASSERT_TRUE(beyond) << beyond.error();
  EXPECT_TRUE((*beyond)->description().ends_with(", cpu, 1 thread; state not looked into")) << (*beyond)->description();
  auto known = beyond_the_built_in_engine();
  known.graph().mutable_node(1)->set_op_type("Elu");
  const auto looked = load(known, "onnxruntime");
  ASSERT_TRUE(looked) << looked.error();
  EXPECT_TRUE((*looked)->description().ends_with(", cpu, 1 thread")) << (*looked)->description();
}

TEST_F(ByOnnxRuntime, WeightsThatThePolicysHashDoesNotCoverAreRefused) {
  auto outside = beyond_the_built_in_engine();
  keep_outside(*outside.graph().mutable_initializer(0), "weights.bin", directory_.path("weights.bin"));
  const auto refused = load(outside, "onnxruntime");
  ASSERT_FALSE(refused) << "weights that can be exchanged under the policy's name were accepted";
  EXPECT_EQ(refused.error(),
            file_ +
                ": tensor 'w' keeps its data in 'weights.bin'; only policy.onnx.data or policy.onnx_data beside the "
                "model is read, which the policy's hash covers: export it under that name, or as one file");
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
