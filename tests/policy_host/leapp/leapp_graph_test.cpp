// SPDX-License-Identifier: Apache-2.0
// Goal: nodes run in their order, data flows within an inference and feedback into the next, from its start values; an
// action chunk keeps its steps. Method: networks small enough to compute by hand, in a bundle written here.
#include "policy_host/leapp/leapp_graph.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "config/load.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_description.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::GraphMaker;

void shape_outputs(GraphMaker& maker, std::initializer_list<std::int64_t> shape) {
  for (onnx::ValueInfoProto& output : *maker.graph().mutable_output())
    for (const std::int64_t size : shape)
      output.mutable_type()->mutable_tensor_type()->mutable_shape()->add_dim()->set_dim_value(size);
}

// first: features = obs + bias;  second: action = 10 * features + past_in, past_out = features + past_in
class TwoNodes : public testing::Test {
 protected:
  void SetUp() override {
    GraphMaker first, second;
    first.input("obs", {1, 2}).input("bias", {1, 2}).output("features").node("Add", {"obs", "bias"}, {"features"});
    second.input("features", {1, 2}).input("past_in", {1, 2}).output("action").output("past_out");
    second.floats("ten", {1}, {10}).node("Mul", {"features", "ten"}, {"tenfold"});
    second.node("Add", {"tenfold", "past_in"}, {"action"});
    second.node("Add", {"features", "past_in"}, {"past_out"});
    shape_outputs(first, {1, 2}), shape_outputs(second, {1, 2});
    yaml_ = fmt::format(
        R"(models:
  first:
    inputs: [{{name: obs, dtype: float32, shape: [1, 2]}}, {{name: bias, dtype: float32, shape: [1, 2]}}]
    outputs: [{{name: features, dtype: float32, shape: [1, 2]}}]
    parameters: {{model_path: first.onnx, sha256sum: {}, backend: onnx}}
  second:
    inputs: [{{name: features, dtype: float32, shape: [1, 2]}}, {{name: past_in, dtype: float32, shape: [1, 2]}}]
    outputs: [{{name: action, dtype: float32, shape: [1, 2]}}, {{name: past_out, dtype: float32, shape: [1, 2]}}]
    parameters: {{model_path: second.onnx, sha256sum: {}, backend: onnx}}
pipeline:
  data_flow: {{first/features: [second/features]}}
  feedback_connections: {{second/past_out: [second/past_in]}}
  initial_values: start.safetensors
  inputs: {{first: [obs, bias]}}
  outputs: {{second: [action]}}
)",
        written("first.onnx", first), written("second.onnx", second));
    start_with(R"({"second/past_in":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]}})");
  }

  // 100, 200 under the names of `map`.
  void start_with(const std::string& map) {
    const std::uint64_t length = map.size();
    const std::array<float, 2> start{100, 200};
    std::ofstream file(directory_.path("start.safetensors"), std::ios::binary);
    file.write(reinterpret_cast<const char*>(&length), 8) << map;
    file.write(reinterpret_cast<const char*>(start.data()), 8);
  }

  std::string written(const std::string& name, const GraphMaker& maker) {
    const std::string bytes = maker.model.SerializeAsString();
    std::ofstream(directory_.path(name), std::ios::binary) << bytes;
    return config::sha256_hex(bytes);
  }
  std::expected<std::unique_ptr<Policy>, std::string> load(const std::string& input = "") {
    std::ofstream(directory_.path("two.yaml")) << yaml_;
    auto graph = load_leapp_graph(directory_.path("two.yaml"), input, "", load_onnx_network);
    if (!graph) return std::unexpected(graph.error());
    return make_network_policy(std::move(graph->networks), std::move(graph->wiring));
  }
  void replace(const std::string& from, const std::string& to) {
    ASSERT_NE(yaml_.find(from), std::string::npos) << from;
    yaml_.replace(yaml_.find(from), from.size(), to);
  }

  test::TemporaryDirectory directory_;
  std::string yaml_;
};

TEST_F(TwoNodes, FeedEachOtherAndTheirOwnPast) {
  auto policy = load();
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_EQ((*policy)->input_size(), 4U);
  EXPECT_TRUE((*policy)->is_recurrent());
  EXPECT_TRUE((*policy)->is_built_in());
  const std::vector<float> input{1, 2, 0.5F, 0};
  std::vector<float> output(2);
  for (int round = 0; round < 2; ++round) {
    (*policy)->reset();
    (*policy)->infer(input, output);
    EXPECT_EQ(output, (std::vector<float>{15 + 100, 20 + 200}));
    (*policy)->infer(input, output);
    EXPECT_EQ(output, (std::vector<float>{15 + 101.5F, 20 + 202}));
  }
}

TEST_F(TwoNodes, TheRobotFileMayListInputsInAnOrderOfItsOwn) {
  auto policy = load("first/bias, obs");
  ASSERT_TRUE(policy) << policy.error();
  std::vector<float> output(2);
  (*policy)->infer(std::vector<float>{0.5F, 0, 1, 2}, output);
  EXPECT_EQ(output[0], 115);
}

TEST_F(TwoNodes, AFlowBackIsFeedbackOrRefused) {
  replace("data_flow: {first/features: [second/features]}",
          "data_flow: {second/past_out: [first/bias], first/features: [second/features]}");
  replace("inputs: {first: [obs, bias]}", "inputs: {first: [obs]}");
  const auto policy = load();
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("data_flow goes from second back to first"), std::string::npos) << policy.error();
}

TEST_F(TwoNodes, StartValuesThatShareBytesAreBoundedTogether) {
  start_with(R"({"second/past_in":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]},
                 "third/again":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}})");
  auto policy = load();
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("'third/again' shares its bytes with others"), std::string::npos) << policy.error();
  // A map is text that becomes many times its size in memory.
  start_with(R"({"__metadata__":{"a":")" + std::string(std::size_t{2} << 20U, ' ') + R"("},
                 "second/past_in":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]}})");
  policy = load();
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("its map is larger than 1 MiB"), std::string::npos) << policy.error();
  start_with(R"({"first/other":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},
                 "second/other":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}})");
  policy = load();
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().find("has no start value"), std::string::npos) << "side by side: " << policy.error();
}

TEST(LeappDescription, AChunkHasStepsAndALineOfTheirOwn) {
  const std::string yaml = R"(models:
  chunk:
    inputs: [{name: q, dtype: float32, shape: [1, 2], kind: state/joint/position, element_names: [a, b]}]
    outputs:
    - {name: target, dtype: float32, shape: [1, 8, 2], kind: target/joint/position, element_names: [null, __temporal_axis__, [a, b]], temporal_period_ms: 20.0}
    - {name: mixed, dtype: float32, shape: [2, 8], kind: target/joint/velocity, element_names: [[a, b], __temporal_axis__], temporal_period_ms: 20.0}
    parameters: {model_path: chunk.onnx, backend: onnx}
pipeline:
  inputs: {chunk: [q]}
  outputs: {chunk: [target, mixed]}
)";
  const auto bundle = read_leapp_bundle(yaml, "chunk.yaml");
  ASSERT_TRUE(bundle) << bundle.error();
  const DescribedPolicy said = describe_leapp(*bundle);
  EXPECT_EQ(said.inputs[0].joints, (std::vector<std::string>{"a", "b"})) << "a flat list names one dimension";
  const DescribedOutput& target = said.outputs[0];
  EXPECT_EQ(target.field, CommandField::q);
  EXPECT_EQ(target.steps, 8U);
  EXPECT_EQ(target.width, 2U);
  EXPECT_EQ(target.step_period, milliseconds(20));
  EXPECT_EQ(target.joints, (std::vector<std::string>{"a", "b"}));
  EXPECT_FALSE(said.outputs[1].field) << "joint after joint, not step after step: not what a chunk is";
}

}  // namespace
}  // namespace takt::policy_host
