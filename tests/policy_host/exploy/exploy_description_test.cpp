// SPDX-License-Identifier: Apache-2.0
// Goal: what exploy's metadata says is read as it stands, imported without a guess and held against the robot file.
// Method: metadata and tensors as its exporter writes them (exploy's documentation and control library), one deviation
// at a time.
#include "policy_host/exploy/exploy_description.hpp"

#include <gtest/gtest.h>

#include "config/deploy_import.hpp"
#include "policy_host/described_import.hpp"

namespace takt::policy_host {
namespace {

using onnx_engine::Metadata;
using onnx_engine::TensorInfo;

Metadata metadata() {
  return {{"exploy_version", "\"0.3.1\""},
          {"update_rate", "50.0"},
          {"base_names", R"({"robot": "pelvis"})"},
          {"obj.robot.joints", R"({"joint_names": ["hip", "knee"]})"},
          {"cmd.se2_velocity.vel",
           R"({"ranges": {"lin_vel_x": [-1.5, 1.5], "lin_vel_y": [0.25, 0.75], "ang_vel_z": [-2.5, 2.5]}})"},
          {"sensor.ray_caster.scan", R"({"pattern_type": "grid", "resolution": 0.1, "size_x": 1.6, "size_y": 1.0})"},
          {"output.joint_targets.legs", R"({"names": ["knee"], "stiffness": [80], "damping": [2.5]})"}};
}

std::vector<TensorInfo> inputs() {
  return {{"obj.robot.joints.pos", {1, 2}},
          {"obj.robot.joints.vel", {1, 2}},
          {"obj.robot.pelvis.w_Q_b", {1, 4}},
          {"obj.robot.pelvis.ang_vel_b_rt_w_in_b", {1, 3}},
          {"obj.robot.pelvis.lin_vel_b_rt_w_in_b", {1, 3}},
          {"obj.box.lid.w_Q_b", {1, 4}},
          {"sensor.imu.torso.w_Q_b", {1, 4}},
          {"sensor.ray_caster.scan.height", {1, 187}},
          {"cmd.se2_velocity.vel", {1, 3}},
          {"memory.actions.in", {1, 1}}};
}

std::vector<TensorInfo> outputs() {
  return {{"output.joint_targets.legs.pos", {1, 1}},
          {"output.joint_targets.legs.vel", {1, 1}},
          {"output.joint_targets.legs.effort", {1, 1}},
          {"actions", {1, 1}},
          {"memory.actions.out", {1, 1}}};
}

TEST(ExployDescription, IsReadAsItStands) {
  const auto read = describe_exploy(metadata(), inputs(), outputs());
  ASSERT_TRUE(read && *read) << (read ? "none" : read.error());
  const DescribedPolicy& said = **read;
  EXPECT_EQ(said.period, milliseconds(20));
  ASSERT_EQ(said.inputs.size(), 9U) << "memory is nobody's input";
  std::vector<Meaning> meanings;
  for (const DescribedInput& input : said.inputs) meanings.push_back(input.meaning);
  EXPECT_EQ(meanings, (std::vector{Meaning::joint_position, Meaning::joint_velocity, Meaning::base_orientation,
                                   Meaning::base_angular_velocity, Meaning::base_linear_velocity, Meaning::sensor,
                                   Meaning::base_orientation, Meaning::sensor, Meaning::command}))
      << "its only IMU is the robot's";
  EXPECT_EQ(said.inputs[0].joints, (std::vector<std::string>{"hip", "knee"}));
  EXPECT_EQ(said.inputs[2].quaternion, "wxyz");
  EXPECT_EQ(sensor_for(said.inputs[5]), "a sensor whose unit is wxyz and whose frame is world") << "of another body";
  EXPECT_EQ(said.inputs[6].quaternion, "wxyz");
  EXPECT_EQ(sensor_for(said.inputs[7]), "a sensor whose unit is m");
  EXPECT_EQ(said.inputs[8].ranges[1], std::pair(0.25, 0.75));
  ASSERT_EQ(said.outputs.size(), 3U);
  EXPECT_EQ(said.outputs[1].field, CommandField::dq);
  EXPECT_EQ(said.outputs[2].field, CommandField::tau_ff);
  EXPECT_EQ(said.outputs[2].joints, (std::vector<std::string>{"knee"}));
  EXPECT_EQ(said.joints.stiffness, (std::vector<double>{80}));
}

TEST(ExployDescription, IsImportedWithoutAGuess) {
  const auto said = describe_exploy(metadata(), inputs(), outputs()).value();
  std::vector<std::string> joints{"knee", "hip"};
  const auto deploy = deploy_file_of(*said, joints);
  ASSERT_TRUE(deploy) << deploy.error();
  const auto text = config::import_deploy_file(
      *deploy, {.robot = "two", .policy_file = "two.onnx", .joint_names = joints, .source = "two.onnx"});
  ASSERT_TRUE(text) << text.error();
  for (const char* const line : {
           "    - { term: base_orientation, order: wxyz }   # obj.robot.pelvis.w_Q_b\n",
           "    - { term: base_orientation, order: wxyz }   # sensor.imu.torso.w_Q_b\n",
           "    - { term: sensor, sensor: FILL_IN }   # obj.box.lid.w_Q_b, 4 values: obj.box.lid.w_Q_b; no robot says "
           "it "
           "of itself: name a sensor whose unit is wxyz and whose frame is world\n",
           "    - { term: command, sensor: cmd_se2_velocity_vel }",
           "command: { minimum: [-1.5, 0.25, -2.5], maximum: [1.5, 0.75, 2.5], when_absent: [0, 0.25, 0] }",
           "  joint_order: [hip, knee]\n",
           "    joints: [knee]\n",
           "    outputs: { velocity: \"output.joint_targets.legs.vel\", torque: \"output.joint_targets.legs.effort\" "
           "}\n",
           "gains: { kp: 80 Nm/rad, kd: 2.5 Nms/rad, damping: 2.5 Nms/rad }",
           "gains: { kp: FILL_IN, kd: FILL_IN, damping: FILL_IN }",
       })
    EXPECT_NE(text->find(line), std::string::npos) << line << "\n" << *text;
}

// Of several IMUs one may be called as the base is; the others are not the robot's.
TEST(ExployDescription, AnImuHasAMeaning) {
  const std::vector<TensorInfo> both{{"sensor.imu.pelvis.w_Q_b", {1, 4}},
                                     {"sensor.imu.pelvis.ang_vel_b_rt_w_in_b", {1, 3}},
                                     {"sensor.imu.pelvis.lin_vel_b_rt_w_in_b", {1, 3}},
                                     {"sensor.imu.head.w_Q_b", {1, 4}},
                                     {"sensor.imu.head.ang_vel_b_rt_w_in_b", {1, 3}},
                                     {"sensor.imu.head.temperature", {1, 1}}};
  const auto said = describe_exploy(metadata(), both, outputs()).value();
  std::vector<Meaning> meanings;
  for (const DescribedInput& input : said->inputs) meanings.push_back(input.meaning);
  EXPECT_EQ(meanings, (std::vector{Meaning::base_orientation, Meaning::base_angular_velocity,
                                   Meaning::base_linear_velocity, Meaning::sensor, Meaning::sensor, Meaning::sensor}));
  EXPECT_EQ(sensor_for(said->inputs[3]), "a sensor whose unit is wxyz and whose frame is world");
  EXPECT_EQ(sensor_for(said->inputs[4]), "a sensor whose unit is rad/s and whose frame is head");
  EXPECT_EQ(sensor_for(said->inputs[5]), "a sensor");
}

TEST(ExployDescription, NamesThatAreMoreThanNamesAreRefused) {
  Metadata joints = metadata();
  joints[3].second = R"({"joint_names": ["hip", "knee]\n  nice: -20 #"]})";
  const auto by_joint = describe_exploy(joints, inputs(), outputs());
  ASSERT_FALSE(by_joint);
  EXPECT_NE(by_joint.error().find("\"knee]\\n  nice: -20 #\" holds \"]\""), std::string::npos) << by_joint.error();
  std::vector<TensorInfo> tensors = inputs();
  tensors[7].name = "sensor.ray_caster.scan\"\n  nice: -20 #.height";
  const auto by_tensor = describe_exploy(metadata(), tensors, outputs());
  ASSERT_FALSE(by_tensor);
  EXPECT_EQ(by_tensor.error().find('\n'), std::string::npos) << by_tensor.error();
}

TEST(ExployDescription, WhatIsNoneOfItsOwnOrContradictsItselfIsSaid) {
  const auto other = describe_exploy({{"joint_names", "a,b"}}, inputs(), outputs());
  ASSERT_TRUE(other);
  EXPECT_FALSE(*other);
  Metadata broken = metadata();
  broken[3].second = "{";
  EXPECT_FALSE(describe_exploy(broken, inputs(), outputs()));
  broken = metadata();
  broken[3].second = R"({"joint_names": ["hip"]})";
  const auto uneven = describe_exploy(broken, inputs(), outputs());
  ASSERT_FALSE(uneven);
  EXPECT_NE(uneven.error().find("obj.robot.joints.pos"), std::string::npos) << uneven.error();
  broken = metadata();
  broken[4].second = R"({"ranges": {"lin_vel_x": [1.5, -1.5], "lin_vel_y": [0, 0], "ang_vel_z": [0, 0]}})";
  const auto exchanged = describe_exploy(broken, inputs(), outputs());
  ASSERT_FALSE(exchanged);
  EXPECT_NE(
      exchanged.error().find("cmd.se2_velocity.vel: another number of entries than values, or a range whose ends"),
      std::string::npos)
      << exchanged.error();
}

}  // namespace
}  // namespace takt::policy_host
