// SPDX-License-Identifier: Apache-2.0
// Goal: the right tensors carry observation and actions, hidden state goes round from step to step and starts over on
// reset, anything else is refused by name. Method: accumulators of two numbers, made here as ONNX files.
#include "policy_host/onnx_policy.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"
#include "tests/support/temporary_directory.hpp"

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
  test::TemporaryDirectory directory_;
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
  EXPECT_EQ(no_input.error(), file() + ": no input named observation, it has h_in, obs; correct policy.input");
  const auto no_output = load(accumulator(), "obs", "action");
  ASSERT_FALSE(no_output);
  EXPECT_EQ(no_output.error(), file() + ": no output named action, it has h_out, actions; correct policy.output");
}

TEST_F(OnnxPolicyTest, RefusesAnInputThatNothingFeeds) {
  const auto policy = load(accumulator("state"));
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("input h_in is neither the observation nor hidden state"), std::string::npos);
}

// actions = a + b + 10 * time_step, of an observation in two inputs.
GraphMaker two_inputs() {
  GraphMaker maker;
  maker.input("a", {1, 2}).input("time_step", {1, 1}).input("b", {1, 1}).output("actions").floats("ten", {1}, {10});
  maker.node("Add", {"a", "b"}, {"sum"});
  maker.node("Mul", {"time_step", "ten"}, {"counted"});
  maker.node("Add", {"sum", "counted"}, {"actions"});
  return maker;
}

TEST_F(OnnxPolicyTest, AnObservationMayComeInSeveralInputsInTheOrderNamed) {
  auto policy = load(two_inputs(), "b, a");
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_EQ((*policy)->input_size(), 3U);
  EXPECT_EQ(infer(**policy, {100, 1, 2}), (std::vector<float>{101, 102}));
  EXPECT_NE(load(two_inputs(), "a").error().find("input b is neither"), std::string::npos);
  EXPECT_NE(load(two_inputs(), "a, a").error().find("named twice"), std::string::npos);
}

TEST_F(OnnxPolicyTest, CountsItsStepsFromTheReset) {
  auto policy = load(two_inputs(), "a,b");
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_EQ(infer(**policy, {1, 2, 0}), (std::vector<float>{1, 2}));
  EXPECT_EQ(infer(**policy, {1, 2, 0}), (std::vector<float>{11, 12}));
  (*policy)->reset();
  EXPECT_EQ(infer(**policy, {1, 2, 0}), (std::vector<float>{1, 2}));
}

// actions = LSTM(obs) over `length` elements, its start state left out, constant, or an input.
GraphMaker recurrent(std::int64_t length, const std::string& start) {
  GraphMaker maker(14);
  maker.input("obs", {length, 1, 2}).floats("w", {1, 4, 2}, std::vector<float>(8, 0.5F));
  maker.floats("r", {1, 4, 1}, std::vector<float>(4, 0.5F)).floats("zero", {1, 1, 1}, {0});
  if (start == "h_in") maker.input("h_in", {1, 1, 1}).input("c_in", {1, 1, 1});
  const std::string cell = start == "h_in" ? "c_in" : start;
  maker.node("LSTM", {"obs", "w", "r", "", "", start, cell}, {"actions", "h_out", "c_out"})
      .with("hidden_size", std::int64_t{1});
  maker.output("actions").output("h_out").output("c_out");
  return maker;
}

TEST_F(OnnxPolicyTest, RefusesARecurrentNetworkWhoseStateGoesNowhere) {
  for (const std::string start : {"", "zero"}) {
    const auto policy = load(recurrent(1, start));
    ASSERT_FALSE(policy) << "start state '" << start << "'";
    EXPECT_EQ(policy.error(), file() +
                                  ": LSTM node 'the_LSTM' begins every inference from the same state, so its memory is "
                                  "lost between observations; export the network with its state as inputs <x>_in and "
                                  "outputs <x>_out");
  }
  EXPECT_TRUE(load(recurrent(1, "h_in")));
  EXPECT_TRUE(load(recurrent(5, ""))) << "a sequence seen anew each time needs no memory";
}

TEST_F(OnnxPolicyTest, RefusesAFileThatIsNoModel) {
  std::ofstream(file()) << "no model";
  EXPECT_FALSE(load_onnx_policy(file(), "obs", "actions"));
  EXPECT_FALSE(load_onnx_policy(directory_.path("absent.onnx"), "obs", "actions"));
}

}  // namespace
}  // namespace takt::policy_host
