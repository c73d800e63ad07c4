// Goal: the right tensors carry observation and actions, hidden state goes round from step to step and starts over on
// reset, anything else is refused by name. Method: accumulators of two numbers, made here as ONNX files.
#include "policy_host/onnx_policy.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/policy_host/fake_server.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::GraphMaker;

class OnnxPolicyTest : public testing::Test {
 protected:
  std::expected<std::unique_ptr<Policy>, std::string> load(const GraphMaker& maker, const std::string& input = "obs",
                                                           const std::string& output = "actions") {
    std::ofstream(file(), std::ios::binary) << maker.model.SerializeAsString();
    return load_onnx_policy(file(), input, output);
  }
  [[nodiscard]] std::string file() const { return directory_.path("policy.onnx"); }
  static std::vector<float> infer(Policy& policy, std::vector<float> input) {
    std::vector<float> output(policy.output_size());
    policy.infer(input, output);
    return output;
  }
  TemporaryDirectory directory_;
};

// actions = 10 * (obs + h_in), h_out = obs + h_in; the state's tensors come first, so that order cannot be relied upon.
GraphMaker accumulator(const std::string& state_out = "h_out") {
  GraphMaker maker;
  maker.input("h_in", {1, 2}).input("obs", {1, 2}).output(state_out).output("actions").floats("ten", {1}, {10});
  maker.node("Add", {"obs", "h_in"}, {state_out});
  maker.node("Mul", {state_out, "ten"}, {"actions"});
  for (onnx::ValueInfoProto& output : *maker.graph().mutable_output()) {
    for (const std::int64_t size : {1, 2}) {
      output.mutable_type()->mutable_tensor_type()->mutable_shape()->add_dim()->set_dim_value(size);
    }
  }
  return maker;
}

TEST_F(OnnxPolicyTest, HiddenStateGoesRoundAndResets) {
  auto policy = load(accumulator());
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_EQ((*policy)->input_size(), 2U);
  EXPECT_EQ((*policy)->output_size(), 2U);
  EXPECT_EQ(infer(**policy, {1, 2}), (std::vector<float>{10, 20}));
  EXPECT_EQ(infer(**policy, {1, 2}), (std::vector<float>{20, 40}));
  (*policy)->reset();
  EXPECT_EQ(infer(**policy, {1, 2}), (std::vector<float>{10, 20}));
}

TEST_F(OnnxPolicyTest, RefusesTensorsThatAreNotThere) {
  const auto no_input = load(accumulator(), "observation");
  ASSERT_FALSE(no_input);
  EXPECT_EQ(no_input.error(), file() + ": no input named observation, it has h_in, obs; mend policy.input");
  const auto no_output = load(accumulator(), "obs", "action");
  ASSERT_FALSE(no_output);
  EXPECT_EQ(no_output.error(), file() + ": no output named action, it has h_out, actions; mend policy.output");
}

TEST_F(OnnxPolicyTest, RefusesAnInputThatNothingFeeds) {
  const auto policy = load(accumulator("state"));
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("input h_in is neither the observation nor hidden state"), std::string::npos);
}

TEST_F(OnnxPolicyTest, RefusesAFileThatIsNoModel) {
  std::ofstream(file()) << "no model";
  EXPECT_FALSE(load_onnx_policy(file(), "obs", "actions"));
  EXPECT_FALSE(load_onnx_policy(directory_.path("absent.onnx"), "obs", "actions"));
}

}  // namespace
}  // namespace takt::policy_host
