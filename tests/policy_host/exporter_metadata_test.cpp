// Goal: an exporter's metadata is read as written, and a robot file that contradicts it is told so before anything
// moves. Method: the small robot and metadata that agrees with it, then one deviation at a time.
#include "policy_host/exporter_metadata.hpp"

#include <gtest/gtest.h>

#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

using Metadata = std::vector<std::pair<std::string, std::string>>;

// small_robot() with gains and poses.
config::RobotConfig robot() {
  auto small = small_robot();
  for (std::size_t i = 0; i < small.joints.size(); ++i) {
    small.joints[i].name = std::string(1, static_cast<char>('a' + i));
    small.joints[i].kp = 40.1234;
    small.joints[i].kd = 1.5;
    small.joints[i].home = 0.1 * static_cast<double>(i);
  }
  return small;
}

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

TEST(ExporterMetadata, AgreesWithTheRobotToItsRounding) {
  const auto differences = compare_metadata(read_exporter_metadata(agreeing()).value(), robot());
  ASSERT_TRUE(differences) << differences.error();
  EXPECT_TRUE(differences->empty()) << differences->front();
}

TEST(ExporterMetadata, SaysWhatDiffers) {
  const auto of = [](const Metadata& metadata) {
    return compare_metadata(read_exporter_metadata(metadata).value(), robot()).value();
  };
  EXPECT_EQ(of(with(agreeing(), "joint_stiffness", "40.123,40.123,40.125")),
            (std::vector<std::string>{"joint c: kp is 40.1234 in the robot's file, 40.125 in the policy's metadata"}));
  EXPECT_EQ(of(with(agreeing(), "default_joint_pos", "0.000,0.200,0.200")),
            (std::vector<std::string>{"joint b: home is 0.1 in the robot's file, 0.2 in the policy's metadata"}));
  EXPECT_EQ(of(with(agreeing(), "joint_names", "a,b,left_knee")),
            (std::vector<std::string>{"joint c is called left_knee in the policy's metadata"}));
}

TEST(ExporterMetadata, RefusesJointsInAnotherOrder) {
  const auto swapped =
      compare_metadata(read_exporter_metadata(with(agreeing(), "joint_names", "b,a,c")).value(), robot());
  ASSERT_FALSE(swapped);
  EXPECT_EQ(swapped.error(), "small.yaml: the policy's joint 0 is b by its metadata, a by policy.joint_order; mend it");
  auto reordered = robot();
  reordered.policy->joint_order = {1, 0, 2};
  EXPECT_TRUE(compare_metadata(read_exporter_metadata(with(agreeing(), "joint_names", "b,a,c")).value(), reordered));
  reordered.policy->joint_order = {1, 0};
  EXPECT_FALSE(compare_metadata(read_exporter_metadata(agreeing()).value(), reordered));
}

}  // namespace
}  // namespace takt::policy_host
