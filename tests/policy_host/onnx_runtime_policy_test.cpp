// Goal: ONNX Runtime behind the Policy port answers what the built-in engine answers, observation after observation,
// state and reset included, and a network that is no policy is refused by the same sentences. Method: the repository's
// networks and, where ../shared has them, published ones (a recurrent one and a transformer's operators among them), 20
// observations with a reset in between, by both engines; skipped, loudly, where the library is not installed.
#include "policy_host/onnx_runtime_policy.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>

#include "policy_host/onnx_policy.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

// ONNX Runtime keeps some bytes of its own for ever; of ours nothing is excused.
#if defined(__SANITIZE_ADDRESS__)
extern "C" const char* __lsan_default_suppressions();   // NOLINT(bugprone-reserved-identifier): the sanitizer's name
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:libonnxruntime.so";
}
#endif

namespace takt::policy_host {
namespace {

using onnx_engine::GraphMaker;

constexpr double kTolerance = 1e-5;
constexpr int kObservations = 20, kResetAt = 12;

class OnnxRuntimePolicyTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto library = installed_onnx_runtime();
    if (!library) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
    library_ = *library;
  }
  [[nodiscard]] std::expected<std::unique_ptr<Policy>, std::string> load(const std::string& file,
                                                                         const std::string& input = "",
                                                                         const std::string& output = "") const {
    auto runtime = onnx_runtime::OnnxRuntime::open(library_);
    if (!runtime) return std::unexpected(runtime.error());
    return load_onnx_runtime_policy(*std::move(runtime), file, input, output);
  }
  // Of all values of all answers, relative where they are large.
  [[nodiscard]] double distance(const std::string& file) const {
    const auto built_in = load_onnx_policy(file, "", "");
    const auto theirs = load(file);
    EXPECT_TRUE(built_in && theirs) << file << (built_in ? "" : built_in.error()) << (theirs ? "" : theirs.error());
    if (!built_in || !theirs) return HUGE_VAL;
    EXPECT_EQ((*built_in)->input_size(), (*theirs)->input_size());
    EXPECT_EQ((*built_in)->is_recurrent(), (*theirs)->is_recurrent());
    EXPECT_FALSE((*theirs)->is_built_in());
    std::mt19937 random(3);
    std::uniform_real_distribution<float> value(-1, 1);
    std::vector<float> input((*built_in)->input_size()), own((*built_in)->output_size()),
        other((*theirs)->output_size());
    EXPECT_EQ(own.size(), other.size());
    double largest = 0;
    for (int i = 0; i < kObservations; ++i) {
      if (i == kResetAt) (*built_in)->reset(), (*theirs)->reset();
      for (float& each : input) each = value(random);
      (*built_in)->infer(input, own);
      (*theirs)->infer(input, other);
      for (std::size_t k = 0; k < own.size(); ++k)
        largest =
            std::max(largest, static_cast<double>(std::abs(own[k] - other[k])) / std::max(1.0F, std::abs(own[k])));
    }
    return largest;
  }
  [[nodiscard]] std::string made(const GraphMaker& maker) const {
    std::ofstream(directory_.path("made.onnx"), std::ios::binary) << maker.model.SerializeAsString();
    return directory_.path("made.onnx");
  }

  std::filesystem::path library_;
  TemporaryDirectory directory_;
};

TEST_F(OnnxRuntimePolicyTest, AnswersAsTheBuiltInEngineDoes) {
  for (const char* const file : {"config/arm6_reach.onnx", "config/arm6_visuomotor_reach.onnx", "config/balancer.onnx",
                                 "config/cart_pole_balance.onnx", "config/dual_arm12_reach.onnx"})
    EXPECT_LE(distance(file), kTolerance) << file;
}

TEST_F(OnnxRuntimePolicyTest, AnswersForPublishedPoliciesToo) {
  const std::filesystem::path shared = "../shared/policies";
  if (!std::filesystem::exists(shared)) GTEST_SKIP() << "NOT TESTED: " << shared << " is not there";
  for (const char* const file :
       {"g1_velocity/policy.onnx", "mujoco_playground/go1_policy.onnx", "mujoco_playground/apollo_policy.onnx"})
    EXPECT_LE(distance(shared / file), kTolerance) << file;
}

// actions = 10 * (obs + h_in), h_out = obs + h_in
GraphMaker accumulator(const std::string& state_out) {
  GraphMaker maker;
  maker.input("h_in", {1, 2}).input("obs", {1, 2}).output(state_out).output("actions").floats("ten", {1}, {10});
  maker.node("Add", {"obs", "h_in"}, {state_out});
  maker.node("Mul", {state_out, "ten"}, {"actions"});
  for (onnx::ValueInfoProto& output : *maker.graph().mutable_output())
    for (const std::int64_t size : {1, 2})
      output.mutable_type()->mutable_tensor_type()->mutable_shape()->add_dim()->set_dim_value(size);
  return maker;
}

TEST_F(OnnxRuntimePolicyTest, StateGoesRoundUntilReset) {
  auto policy = load(made(accumulator("h_out")), "obs", "actions");
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_TRUE((*policy)->is_recurrent());
  std::vector<float> input{1, 2}, output(2);
  for (const float expected : {10.0F, 20.0F, 30.0F}) {
    (*policy)->infer(input, output);
    EXPECT_EQ(output[0], expected);
  }
  (*policy)->reset();
  (*policy)->infer(input, output);
  EXPECT_EQ(output[1], 20.0F);
}

TEST_F(OnnxRuntimePolicyTest, WhatIsNoPolicyIsRefusedByName) {
  const auto no_state = load(made(accumulator("elsewhere")), "obs", "actions");
  ASSERT_FALSE(no_state);
  EXPECT_NE(no_state.error().find("input h_in is neither the observation nor hidden state"), std::string::npos)
      << no_state.error();
  std::ofstream(directory_.path("text.onnx")) << "no network";
  const auto text = load(directory_.path("text.onnx"));
  ASSERT_FALSE(text);
  EXPECT_NE(text.error().find("text.onnx: ONNX Runtime: "), std::string::npos) << text.error();
  EXPECT_EQ(text.error().find('\n'), std::string::npos);
}

}  // namespace
}  // namespace takt::policy_host
