// SPDX-License-Identifier: Apache-2.0
// Goal: a LEAPP bundle is read as it stands, and one in which a value would have to be guessed is refused with its
// place. Method: a small bundle with one deviation at a time; a published one (values as published) in ../shared.
#include "policy_host/leapp/leapp_bundle.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <span>

#include "config/document.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::policy_host {
namespace {

const std::string kSmall = R"(models:
  walk:
    inputs:
    - {name: quat, dtype: float32, shape: [1, 4], type: tensor, kind: state/body/rotation, element_names: [[qx, qy, qz, qw]]}
    - {name: past_in, dtype: float32, shape: [5, 1, 2], type: tensor}
    outputs:
    - {name: target, dtype: float32, shape: [1, 8, 2], type: tensor, kind: target/joint/position, element_names: [null, __temporal_axis__, [a, b]], temporal_period_ms: 20.0}
    - {name: past_out, dtype: float32, shape: [5, 1, 2], type: tensor}
    parameters: {model_path: walk.onnx, sha256sum: abc, backend: onnx, opset_version: 20}
pipeline:
  data_flow: {}
  feedback_flow:
    walk/past_out: [walk/past_in]
  initial_values: walk.safetensors
  inputs: {walk: [quat]}
  outputs: {walk: [target]}
  configs: {frequency: 50.0}
system information: {leapp config version: '1.1'}
)";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(LeappBundle, IsReadAsItStands) {
  const auto bundle = read_leapp_bundle(kSmall, "walk.yaml");
  ASSERT_TRUE(bundle) << bundle.error();
  ASSERT_EQ(bundle->nodes.size(), 1U);
  const LeappNode& node = bundle->nodes[0];
  EXPECT_EQ(node.name, "walk");
  EXPECT_EQ(node.model_path, "walk.onnx");
  EXPECT_EQ(node.sha256, "abc");
  EXPECT_EQ(node.backend, "onnx");
  EXPECT_EQ(node.opset, 20);
  ASSERT_EQ(node.inputs.size(), 2U);
  EXPECT_EQ(node.inputs[0].kind, "state/body/rotation");
  EXPECT_EQ(node.inputs[0].element_names, (std::vector<std::vector<std::string>>{{"qx", "qy", "qz", "qw"}}));
  EXPECT_EQ(node.inputs[1].kind, "");
  EXPECT_FALSE(node.inputs[0].temporal);
  EXPECT_TRUE(node.outputs[0].temporal);
  EXPECT_EQ(node.outputs[0].temporal_period_ms, 20.0);
  EXPECT_EQ(node.outputs[0].shape, (std::vector<std::int64_t>{1, 8, 2}));
  ASSERT_EQ(bundle->feedback.size(), 1U);
  EXPECT_EQ(bundle->feedback[0].from, (LeappPort{"walk", "past_out"}));
  EXPECT_EQ(bundle->feedback[0].to, (LeappPort{"walk", "past_in"}));
  EXPECT_EQ(bundle->inputs, (std::vector<LeappPort>{{"walk", "quat"}}));
  EXPECT_EQ(bundle->frequency_hz, 50.0);
  EXPECT_EQ(bundle->version, "1.1");
  EXPECT_TRUE(bundle->notes.empty()) << bundle->notes.front();
}

TEST(LeappBundle, FeedbackHasTwoNames) {
  const auto bundle = read_leapp_bundle(with(kSmall, "feedback_flow", "feedback_connections"), "walk.yaml");
  ASSERT_TRUE(bundle) << bundle.error();
  EXPECT_EQ(bundle->feedback.size(), 1U);
}

TEST(LeappBundle, WhatIsLeftOpenIsSaidAndNotGuessed) {
  const auto names = read_leapp_bundle(with(kSmall, "[[qx, qy, qz, qw]]", "[[qx, qy, qz]]"), "walk.yaml");
  ASSERT_TRUE(names) << names.error();
  ASSERT_EQ(names->notes.size(), 1U);
  EXPECT_EQ(names->notes[0], "quat: 3 names for 4 values; which is which the file does not say");
  const auto key = read_leapp_bundle(with(kSmall, "type: tensor, kind", "unit: rad, kind"), "walk.yaml");
  ASSERT_TRUE(key) << key.error();
  EXPECT_EQ(key->notes, (std::vector<std::string>{"quat: `unit` is not read"}));
}

struct Deviation {
  const char *when, *from, *to, *says;
};

void expect_refused(std::span<const Deviation> deviations) {
  for (const Deviation& deviation : deviations) {
    SCOPED_TRACE(deviation.when);
    const auto bundle = read_leapp_bundle(with(kSmall, deviation.from, deviation.to), "walk.yaml");
    ASSERT_FALSE(bundle);
    EXPECT_NE(bundle.error().find(deviation.says), std::string::npos) << bundle.error();
    EXPECT_TRUE(bundle.error().starts_with("walk.yaml:")) << bundle.error();
  }
}

TEST(LeappBundle, RefusesWhatWouldHaveToBeGuessed) {
  const Deviation deviations[] = {
      {"an input nobody feeds", "inputs: {walk: [quat]}", "inputs: {walk: []}",
       "input 'quat' of model 'walk' is fed by nothing"},
      {"an input fed twice", "inputs: {walk: [quat]}", "inputs: {walk: [quat, past_in]}",
       "'past_in' of model 'walk' is fed more than once"},
      {"a flow from nowhere", "walk/past_out:", "walk/past:", "model 'walk' has no output 'past'"},
      {"a flow to another shape", "name: past_out, dtype: float32, shape: [5, 1, 2]",
       "name: past_out, dtype: float32, shape: [4, 1, 2]", "differ in shape"},
      {"no model", "model_path: walk.onnx, ", "", "`model_path` is missing"},
      {"a negative shape", "shape: [1, 4]", "shape: [1, -4]", "a shape that cannot be: -4 here"},
      {"a shape beyond memory", "shape: [1, 4]", "shape: [1099511627776, 1099511627776]", "a shape that cannot be"},
      {"a negative frequency", "frequency: 50.0", "frequency: -50.0", "frequency is -50.0, and must be above 0"},
      {"a frequency that is none", "frequency: 50.0", "frequency: nan", "'nan' is not a number"},
      {"steps at once", "temporal_period_ms: 20.0", "temporal_period_ms: 0",
       "temporal_period_ms is 0, and must be above"},
      {"a shape of words", "shape: [1, 4]", "shape: [1, four]", "'four' is not a number"},
  };
  expect_refused(deviations);
  EXPECT_FALSE(read_leapp_bundle("- a\n", "list.yaml"));
}

TEST(LeappBundle, RefusesNamesThatAreMoreThanNames) {
  const Deviation deviations[] = {
      {"an element", "[qx,", "[\"x\\n    command: { when_absent: [9] } #\",", "element_names \"x\\n    command"},
      {"a tensor", "name: quat", "name: \"q\\\"\\n  nice: -20 #\"", "name \"q\\\"\\n  nice: -20 #\" holds \"\\\"\""},
      {"a kind", "kind: state/body/rotation", "kind: \"x\\n    - { term: last_action } #\"", "kind \"x\\n"},
      {"a port", "inputs: {walk: [quat]}", "inputs: {walk: [\"a\\nb\"]}", "inputs \"a\\nb\""},
      {"a key nobody reads", "type: tensor, kind", "\"a\\nb: c\": 1, kind", "quat \"a\\nb: c\""},
      {"a network", "model_path: walk.onnx", "model_path: \"walk'.onnx\"", "model_path \"walk'.onnx\" holds \"'\""},
      {"nothing", "[qx, qy", "['', qy", "element_names \"\" is empty"},
  };
  expect_refused(deviations);
}

TEST(LeappBundle, APublishedOneIsReadWithoutAGuess) {
  const std::string file = "../shared/policies/agile_leapp/Velocity-G1-v0.yaml";
  TAKT_NEEDS_SHARED(file);
  const auto text = config::read_file(file);
  ASSERT_TRUE(text) << text.error();
  const auto bundle = read_leapp_bundle(*text, file);
  ASSERT_TRUE(bundle) << bundle.error();
  ASSERT_EQ(bundle->nodes.size(), 1U);
  EXPECT_EQ(bundle->nodes[0].inputs.size(), 7U);
  EXPECT_EQ(bundle->nodes[0].outputs.size(), 4U);
  EXPECT_EQ(bundle->nodes[0].opset, 20);
  EXPECT_EQ(bundle->inputs.size(), 6U);
  EXPECT_EQ(bundle->outputs.size(), 3U);
  EXPECT_EQ(bundle->feedback.size(), 1U);
  EXPECT_EQ(bundle->frequency_hz, 50.0);
  EXPECT_EQ(bundle->notes,
            (std::vector<std::string>{"base_velocity: 3 names for 4 values; which is which the file does not say"}));
}

}  // namespace
}  // namespace takt::policy_host
