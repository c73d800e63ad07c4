// SPDX-License-Identifier: Apache-2.0
// Goal: what an exporter left in an ONNX file is held against the robot file by its loader, whichever engine runs
// it and however the file is called. Method: a file of metadata alone, an engine that takes anything, one deviation.
#include "policy_host/assemble_policy.hpp"

#include <gtest/gtest.h>

#include <array>
#include <fstream>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"
#include "tests/policy_host/small_robot.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;

class AnyNetwork final : public Network {
 public:
  [[nodiscard]] std::span<const TensorInfo> inputs() const override { return {&in_, 1}; }
  [[nodiscard]] std::span<const TensorInfo> outputs() const override { return {&out_, 1}; }
  std::span<float> input(std::size_t) override { return obs_; }
  [[nodiscard]] std::span<const float> output(std::size_t) const override { return actions_; }
  void run() override {}

 private:
  TensorInfo in_{"obs", {1, 10}}, out_{"actions", {1, 12}};
  std::array<float, 10> obs_{};
  std::array<float, 12> actions_{};
};

class AssemblePolicy : public testing::Test {
 protected:
  std::string refusal(const std::string& name, std::initializer_list<std::pair<const char*, const char*>> metadata) {
    onnx_engine::GraphMaker maker;
    maker.model.mutable_opset_import(0)->set_version(22);  // beyond the built-in engine
    for (const auto& [key, value] : metadata) {
      auto* const property = maker.model.add_metadata_props();
      property->set_key(key);
      property->set_value(value);
    }
    auto robot = small_robot();
    robot.policy->file = directory_.path(name);
    std::ofstream(robot.policy->file, std::ios::binary) << maker.model.SerializeAsString();
    const auto policy = assemble_policy(robot, [](const auto&) { return std::make_unique<AnyNetwork>(); });
    return policy ? "" : policy.error();
  }

  test::TemporaryDirectory directory_;
};

TEST_F(AssemblePolicy, ListsOfJointsAreHeldAgainstTheRobotFile) {
  for (const char* const name : {"policy.onnx", "policy.model", "policy"}) {
    EXPECT_EQ(refusal(name, {{"joint_names", "a,b,c"}}), "") << name;
    EXPECT_NE(refusal(name, {{"joint_names", "b,a,c"}}).find("the policy's joint 0 is b by its metadata"),
              std::string::npos)
        << name;
    EXPECT_NE(refusal(name, {{"joint_names", "a,b,c"}, {"action_scale", "0.5"}}).find("is scaled by 0.5"),
              std::string::npos)
        << name;
  }
}

TEST_F(AssemblePolicy, ExploysMetadataIsReadWhateverTheFileIsCalled) {
  for (const char* const name : {"policy.onnx", "policy.model"})
    EXPECT_NE(refusal(name, {{"exploy_version", "1"}, {"update_rate", "100"}})
                  .find("the exploy policy gives targets as they are"),
              std::string::npos)
        << name;
}

TEST_F(AssemblePolicy, WhatIsNoOnnxFileIsItsEnginesAffair) {
  auto robot = small_robot();
  robot.policy->file = directory_.path("policy.pt");
  std::ofstream(robot.policy->file) << "PK\x03\x04 a module";
  EXPECT_TRUE(assemble_policy(robot, [](const auto&) { return std::make_unique<AnyNetwork>(); }));
}

}  // namespace
}  // namespace takt::policy_host
