// SPDX-License-Identifier: Apache-2.0
// Goal: an exporter's metadata is read as written, and a robot file begins with it. Method: metadata as exporters write
// it, then one deviation at a time.
#include "policy_host/exporter_metadata.hpp"

#include <gtest/gtest.h>

#include "config/deploy_import.hpp"
#include "config/load.hpp"

namespace takt::policy_host {
namespace {

using Metadata = std::vector<std::pair<std::string, std::string>>;

Metadata agreeing() {
  return {{"joint_names", "a, b,c"},
          {"joint_stiffness", "40.123,40.123,40.123"},
          {"joint_damping", "1.500,1.500,1.500"},
          {"default_joint_pos", "0.000,0.100,0.200"},
          {"observation_names", "base_ang_vel,joint_pos"},
          {"run_path", "somewhere, else"}};
}

Metadata with(Metadata metadata, const std::string& key, const std::string& value) {
  for (auto& entry : metadata) {
    if (entry.first == key) entry.second = value;
  }
  return metadata;
}

TEST(ExporterMetadata, IsReadAsWritten) {
  const auto read = read_exporter_metadata(agreeing());
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->joint_names, (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_EQ(read->stiffness, (std::vector<double>{40.123, 40.123, 40.123}));
  EXPECT_EQ(read->observation_names.size(), 2U);
  EXPECT_TRUE(read->action_scale.empty());
  EXPECT_TRUE(read->rounded);
  EXPECT_FALSE(read_exporter_metadata(with(agreeing(), "joint_damping", "1.50001,1,1"))->rounded);
  EXPECT_TRUE(read_exporter_metadata({{"joint_stiffness", "no number"}})->joint_names.empty()) << "another exporter's";
}

TEST(ExporterMetadata, RefusesListsThatAreNone) {
  const auto words = read_exporter_metadata(with(agreeing(), "joint_damping", "1,soft,1"));
  ASSERT_FALSE(words);
  EXPECT_EQ(words.error(), "metadata joint_damping: 'soft' is not a number; export the policy again");
  const auto few = read_exporter_metadata(with(agreeing(), "joint_damping", "1,1"));
  ASSERT_FALSE(few);
  EXPECT_EQ(few.error(), "metadata: a list of 2 numbers for 3 joints; export the policy again");
}

// A name comes to stand in a robot file and on terminals.
TEST(ExporterMetadata, RefusesNamesThatAreMoreThanNames) {
  for (const char* const key : {"joint_names", "observation_names", "action_joint_names"}) {
    Metadata metadata = agreeing();
    metadata.emplace_back("action_joint_names", "a,b,c");
    const auto odd = read_exporter_metadata(with(metadata, key, "a,joint_pos\n    - { term: last_action } #,c"));
    ASSERT_FALSE(odd) << key;
    EXPECT_TRUE(odd.error().starts_with(std::string("metadata ") + key + ": \"joint_pos\\n")) << odd.error();
    EXPECT_EQ(odd.error().find('\n'), std::string::npos) << odd.error();
  }
}

// --- as the beginning of a robot file ---

Metadata of_an_export() {
  return {{"joint_names", "hip,knee"},      {"joint_stiffness", "100.000,40.000"},
          {"joint_damping", "2.000,1.000"}, {"default_joint_pos", "-0.500,0.300"},
          {"action_scale", "0.250,0.500"},  {"observation_names", "base_ang_vel,joint_pos,velocity_commands"}};
}

std::expected<config::DeployFile, std::string> deploy_of(const Metadata& metadata,
                                                         const std::vector<std::string>& joints = {"knee", "hip"}) {
  const auto read = read_exporter_metadata(metadata);
  EXPECT_TRUE(read) << read.error();
  return deploy_file_of(read.value(), joints);
}

std::string robot_file_of(const Metadata& metadata) {
  const auto deploy = deploy_of(metadata);
  EXPECT_TRUE(deploy) << deploy.error();
  return config::import_deploy_file(
             *deploy,
             {.robot = "walker", .policy_file = "policy.onnx", .joint_names = {"knee", "hip"}, .source = "policy.onnx"})
      .value();
}

TEST(ExporterMetadata, GainsGoToTheRobotsOrderAndPosesStayInThePolicys) {
  const auto deploy = deploy_of(of_an_export());
  ASSERT_TRUE(deploy) << deploy.error();
  EXPECT_EQ(deploy->robot_joint, (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(deploy->stiffness, (std::vector<double>{40, 100}));
  EXPECT_EQ(deploy->damping, (std::vector<double>{1, 2}));
  EXPECT_EQ(deploy->default_position, (std::vector<double>{-0.5, 0.3}));
  EXPECT_EQ(deploy->remarks.size(), 1U) << "rounded";
  EXPECT_TRUE(deploy_of(with(of_an_export(), "joint_damping", "2.00001,1"))->remarks.empty());
}

// An observation's name is its author's: mjlab's tasks call a relative position joint_pos. A period is nowhere.
TEST(ExporterMetadata, WhatItDoesNotSayIsLeftToBeFilledIn) {
  const std::string text = robot_file_of(of_an_export());
  EXPECT_NE(text.find("    - { term: FILL_IN, scale: FILL_IN, history: FILL_IN }   # called joint_pos\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("  period: FILL_IN\n  step_period: FILL_IN"), std::string::npos) << text;
  EXPECT_NE(text.find("scale: [0.25, 0.5], offset: FILL_IN }"), std::string::npos) << text;
  EXPECT_NE(text.find("joint_order: [hip, knee]"), std::string::npos) << text;
  EXPECT_NE(text.find("# Note: gains, poses and scales have three decimals at most"), std::string::npos) << text;
  EXPECT_EQ(text.find("sensors:"), std::string::npos) << "nothing is known to come from one";
  const auto robot = config::parse(text, "walker.yaml");
  ASSERT_FALSE(robot);
  for (const char* key : {"policy.period", "policy.action.offset", "policy.observation[1].term"})
    EXPECT_NE(robot.error().find(key), std::string::npos) << key << "\n" << robot.error();
}

TEST(ExporterMetadata, WhatItDoesSayIsTaken) {
  Metadata newer = of_an_export();
  newer.emplace_back("action_offset", "-0.500,0.300");
  newer.emplace_back("observation_history_lengths", "5,0,1");
  newer.emplace_back("action_joint_names", "hip,knee");
  const std::string text = robot_file_of(newer);
  EXPECT_NE(text.find("offset: home }"), std::string::npos) << text;
  EXPECT_NE(text.find("history: 5 }   # called base_ang_vel"), std::string::npos) << text;
  EXPECT_NE(text.find("history: 1 }   # called joint_pos"), std::string::npos) << "0: none but the newest";
  const std::string one = robot_file_of(with(of_an_export(), "action_scale", "0.25"));
  EXPECT_NE(one.find("scale: 0.25, "), std::string::npos) << one;
}

TEST(ExporterMetadata, WhatCannotStandInARobotFileIsRefusedByName) {
  const auto why = [](const Metadata& metadata, const std::vector<std::string>& joints = {"hip", "knee"}) {
    const auto deploy = deploy_of(metadata, joints);
    return deploy ? "" : deploy.error();
  };
  EXPECT_NE(why({{"run_path", "x"}}).find("holds no metadata of mjlab's"), std::string::npos);
  EXPECT_NE(why({{"joint_names", "hip,knee"}}).find("joint_stiffness is missing"), std::string::npos);
  EXPECT_NE(why(of_an_export(), {"hip", "ankle"}).find("joints hip, knee; the robot's are hip, ankle"),
            std::string::npos);
  EXPECT_NE(why(of_an_export(), {"hip", "knee", "ankle"}).find("name all and no others"), std::string::npos);
  EXPECT_NE(why(with(of_an_export(), "action_scale", "1,2,3")).find("3 action scales or offsets for 2 joints"),
            std::string::npos);
  Metadata some = of_an_export();
  some.emplace_back("action_joint_names", "hip");
  EXPECT_NE(why(some).find("moves 1 of 2 joints"), std::string::npos) << why(some);
  some.back() = {"observation_history_lengths", "1,2"};
  EXPECT_NE(why(some).find("2 observation_history_lengths for 3 observations"), std::string::npos) << why(some);
  some.back() = {"observation_history_lengths", "1,100,1"};
  EXPECT_NE(why(some).find("an observation_history_length of 100, which a robot file does not hold"), std::string::npos)
      << why(some);
}

}  // namespace
}  // namespace takt::policy_host
