// SPDX-License-Identifier: Apache-2.0
// Goal: a robot file that contradicts what an exporter says is refused, and what a robot may have of its own is said.
// Method: the small robot and metadata that agrees with it, then one deviation at a time.
#include "policy_host/metadata_comparison.hpp"

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
          {"action_scale", "0.250,0.500,0.500"},
          {"action_offset", "0.000,0.100,0.200"},
          {"action_joint_names", "a,b,c"},
          {"observation_names", "joint_pos,eye,actions"},
          {"observation_history_lengths", "0,2,1"}};
}

config::RobotConfig fitting() {
  auto fits = robot();
  fits.policy->action.scale = {0.25, 0.5, 0.50004};
  fits.policy->action.offset = config::OffsetKind::home;
  return fits;
}

// Without the key where `value` is empty.
Metadata with(Metadata metadata, const std::string& key, const std::string& value) {
  std::erase_if(metadata, [&](auto& entry) {
    if (entry.first == key) entry.second = value;
    return entry.second.empty();
  });
  return metadata;
}

std::expected<std::vector<std::string>, std::string> compared(const Metadata& metadata,
                                                              const config::RobotConfig& robot = fitting()) {
  return compare_metadata(read_exporter_metadata(metadata).value(), robot);
}

TEST(MetadataComparison, JointsAreKnownByWhatAnImportCallsThem) {
  auto renamed = fitting();
  renamed.joints[0].name = "left_hip_0";
  Metadata metadata = with(agreeing(), "joint_names", "left/hip:0, b,c");
  metadata = with(metadata, "action_joint_names", "left/hip:0,b,c");
  const auto same = compared(metadata, renamed);
  ASSERT_TRUE(same) << same.error();
  EXPECT_TRUE(same->empty());
}

TEST(MetadataComparison, AgreesToItsRounding) {
  const auto differences = compared(agreeing());
  ASSERT_TRUE(differences) << differences.error();
  EXPECT_TRUE(differences->empty()) << differences->front();
  EXPECT_TRUE(compared({{"run_path", "x"}}));
}

TEST(MetadataComparison, GainsAndPosesAreSaid) {
  EXPECT_EQ(compared(with(agreeing(), "joint_stiffness", "40.123,40.123,40.125")).value(),
            (std::vector<std::string>{"joint c: kp is 40.1234 in the robot's file, 40.125 in the policy's metadata"}));
  EXPECT_EQ(compared(with(agreeing(), "default_joint_pos", "0.000,0.200,0.200")).value(),
            (std::vector<std::string>{"joint b: home is 0.1 in the robot's file, 0.2 in the policy's metadata"}));
  auto other = fitting();
  other.policy->action.offset = config::OffsetKind::zero;
  EXPECT_EQ(
      compared(with(agreeing(), "action_offset", ""), other)->front(),
      "joint b: the action's offset is 0 in the robot's file, the pose 0.1 in the policy's metadata, which has no "
      "action_offset");
  EXPECT_EQ(compared(with(agreeing(), "observation_names", "joint_pos,eye"))->size(), 0U);
  EXPECT_EQ(compared(with(agreeing(), "observation_history_lengths", "1,2"))->front(),
            "2 observations in the policy's metadata, 3 terms in the robot's file: which history is whose is not "
            "compared");
}

TEST(MetadataComparison, ContradictionsAreRefused) {
  const struct {
    const char *key, *value, *says;
  } deviations[] = {
      {"joint_names", "b,a,c", "the policy's joint 0 is b by its metadata, a by policy.joint_order"},
      {"joint_names", "a,b,left_knee", "1 joints that this robot does not have, the first is left_knee"},
      {"action_joint_names", "b,a,c", "the policy's output 0 is b by its metadata, a by policy.action.joints"},
      {"action_joint_names", "a,b", "the policy's metadata has 2 outputs, policy.action.joints 3"},
      {"action_scale", "0.1", "the action of joint a is scaled by 0.1 by the policy's metadata, by 0.25 by"},
      {"action_scale", "0.250,0.500,0.501", "the action of joint c is scaled by 0.501"},
      {"action_scale", "0.250,0.500", "2 values of action_scale, the policy 3 outputs"},
      {"action_offset", "0,0,0", "the action of joint b is from 0 rad by the policy's metadata, from 0.1 rad by"},
      {"observation_history_lengths", "1,1,1", "a history of 1 for observation 1, policy.observation[1] of 2"},
      {"observation_history_lengths", "1,2,5", "a history of 5 for observation 2, policy.observation[2] of 1"},
  };
  for (const auto& deviation : deviations) {
    SCOPED_TRACE(deviation.says);
    const auto agrees = compared(with(agreeing(), deviation.key, deviation.value));
    ASSERT_FALSE(agrees);
    EXPECT_NE(agrees.error().find(deviation.says), std::string::npos) << agrees.error();
    EXPECT_TRUE(agrees.error().starts_with("small.yaml: ")) << agrees.error();
    EXPECT_EQ(agrees.error().find('\n'), std::string::npos);
  }
  auto other = fitting();
  other.policy->action.offset = config::OffsetKind::measured;
  EXPECT_NE(compared(agreeing(), other).error().find("from what is measured by policy.action.offset"),
            std::string::npos);
}

TEST(MetadataComparison, JointsStandInThePolicysOrder) {
  auto reordered = fitting();
  reordered.policy->joint_order = {1, 0, 2};
  EXPECT_FALSE(compared(agreeing(), reordered));
  const Metadata plain{{"joint_names", "b,a,c"}, {"joint_stiffness", "40.123,40.123,40.123"}};
  EXPECT_TRUE(compared(plain, reordered));
  reordered.policy->joint_order = {1, 0};
  EXPECT_FALSE(compared(plain, reordered));
}

TEST(MetadataComparison, OtherExportersJointsAreKnownByName) {
  EXPECT_EQ(joint_differences({{"c", "z", "a"}, {40.1234, 1, 7}, {1.5, 1, 1.5}, {}}, fitting(), 1e-5, "the bundle"),
            (std::vector<std::string>{"joint a: kp is 40.1234 in the robot's file, 7 in the bundle"}));
}

}  // namespace
}  // namespace takt::policy_host
