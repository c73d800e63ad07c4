// SPDX-License-Identifier: Apache-2.0
// Goal: what a published model says of joints is read as it means it. Method: a small MJCF and URDF written by the
// test, each fact by each of its spellings; what cannot be read is one sentence.
#include "simulation/model_survey.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace takt::plant {
namespace {

class ModelSurveyTest : public testing::Test {
 protected:
  ~ModelSurveyTest() override { std::filesystem::remove(path_); }
  [[nodiscard]] std::expected<config::ModelFacts, std::string> survey(const std::string& text) const {
    std::ofstream(path_) << text;
    return survey_model(path_);
  }
  std::string path_ = testing::TempDir() + fmt::format("takt-survey-{}.xml", getpid());
};

constexpr const char* kRobot = R"(<mujoco>
  <default><default class="strong"><joint actuatorfrcrange="-88 99" armature="0.01"/></default></default>
  <worldbody><body><freejoint/><geom type="box" size="1 1 1" mass="10000"/><site name="nose"/><site name="torso_imu"/>
    <body><joint name="hip" class="strong" axis="0 1 0" limited="true" range="-90 45"/><geom type="sphere" size="0.1" pos="0 0 -1" mass="2"/></body>
    <body><joint name="knee" axis="0 1 0"/><geom type="sphere" size="0.1" mass="1"/></body>
    <body><joint name="ankle" axis="0 1 0"/><geom type="sphere" size="0.1" mass="1"/></body>
  </body></worldbody>
  <actuator>
    <motor joint="knee" gear="10" ctrlrange="-3 3"/>
    <position joint="ankle" kp="40" ctrlrange="-1 1" forcerange="-50 60"/>
  </actuator>
  <sensor><gyro site="nose"/></sensor>
  <keyframe><key name="crouch" qpos="0 0 1 1 0 0 0 0 0 0"/><key name="home" qpos="0 0 1 1 0 0 0 0 0 0"/></keyframe>
</mujoco>)";

TEST_F(ModelSurveyTest, ReadsWhatAnMjcfSays) {
  const auto facts = survey(kRobot);
  ASSERT_TRUE(facts) << facts.error();
  ASSERT_EQ(facts->joints.size(), 3U);
  const config::ModelJoint& hip = facts->joints[0];
  EXPECT_EQ(hip.name, "hip");
  ASSERT_TRUE(hip.position);
  EXPECT_NEAR(hip.position->second, 0.785398, 1e-6) << "degrees are MJCF's own unit";
  EXPECT_EQ(hip.torque, 88) << "of its class; the smaller end";
  EXPECT_NEAR(hip.inertia, 2 + 2 * 0.4 * 0.01 + 0.01, 0.05) << "2 kg at 1 m on a heavy base";
  EXPECT_FALSE(hip.velocity);
  EXPECT_EQ(facts->joints[1].torque, 30) << "a motor's range by its gear";
  EXPECT_EQ(facts->joints[2].torque, 50) << "a servo's range is an angle; its force counts";
  EXPECT_FALSE(facts->joints[2].position);
  EXPECT_EQ(facts->motors, (std::vector<std::string>{"knee", "ankle"})) << "as the actuators stand";
  EXPECT_EQ(facts->imu_site, "nose") << "where the gyro is";
  EXPECT_EQ(facts->keyframe, "home");
}

TEST_F(ModelSurveyTest, ReadsWhatAnUrdfSays) {
  const auto facts = survey(R"(<robot name="arm"><link name="base"/>
    <link name="upper"><inertial><origin xyz="0 0 -1"/><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="2" effort="40" velocity="3"/></joint></robot>)");
  ASSERT_TRUE(facts) << facts.error();
  ASSERT_EQ(facts->joints.size(), 1U);
  EXPECT_EQ(facts->joints[0].name, "shoulder");
  EXPECT_EQ(facts->joints[0].torque, 40);
  EXPECT_EQ(facts->joints[0].velocity, 3);
  EXPECT_EQ(facts->joints[0].position, (std::pair<double, double>{-1, 2}));
  EXPECT_NEAR(facts->joints[0].inertia, 2.01, 1e-6);
}

// A tetrahedron, as STL in binary.
void write_mesh(const std::filesystem::path& path) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  const float corners[4][3] = {{0, 0, 0}, {0.1F, 0, 0}, {0, 0.1F, 0}, {0, 0, 0.1F}};
  const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const std::string header(80, ' ');
  const std::uint32_t count = 4;
  const float normal[3] = {0, 0, 1};
  const std::uint16_t none = 0;
  const auto put = [&](const auto& value) { file.write(reinterpret_cast<const char*>(&value), sizeof value); };
  file << header;
  put(count);
  for (const auto& face : faces) {
    put(normal);
    for (const int corner : face) put(corners[corner]);
    put(none);
  }
}

TEST_F(ModelSurveyTest, FindsAUrdfsMeshesBesideItAndInItsPackage) {
  const std::filesystem::path package =
      testing::TempDir() + fmt::format("takt-package-{}", getpid()) + "/arm_description";
  write_mesh(package / "meshes/upper.stl");
  path_ = package / "urdf/arm.urdf";
  std::filesystem::create_directories(package / "urdf");
  for (const char* named : {"package://arm_description/meshes/upper.stl", "../meshes/upper.stl"}) {
    const auto facts = survey(fmt::format(
        R"(<robot name="arm"><link name="base"/><link name="upper"><inertial><origin xyz="0 0 -1"/><mass value="2"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><mesh filename="{}"/></geometry></collision></link>
        <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="2" effort="40" velocity="3"/></joint></robot>)",
        named));
    ASSERT_TRUE(facts) << named << ": " << facts.error();
    EXPECT_EQ(facts->joints.size(), 1U);
  }
  std::filesystem::remove_all(package.parent_path());
}

TEST_F(ModelSurveyTest, ATransmissionsJointHasNoLimits) {
  const auto facts = survey(R"(<robot name="arm"><link name="base"/>
    <link name="upper"><inertial><origin xyz="0 0 -1"/><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="2" effort="40" velocity="3"/></joint>
    <transmission name="t"><joint name="shoulder"/><limit effort="1" velocity="1"/></transmission></robot>)");
  ASSERT_TRUE(facts) << facts.error();
  EXPECT_EQ(facts->joints[0].torque, 40);
}

// Goal: no text of a model ends the program or takes long. Method: the kinds that once did, a megabyte each.
TEST_F(ModelSurveyTest, AHostileTextIsRefusedAndNothingEnds) {
  const std::string megabyte(1'000'000, 'a'), blanks(1'000'000, ' ');
  std::string tags, quotes;
  for (int i = 0; i < 100'000; ++i) {
    tags += "<joint name='";
    quotes += "<a b=\"";
  }
  const std::string texts[] = {
      "<mujoco><joint actuatorfrcrange=\"" + megabyte + "\"/></mujoco>",
      "<mujoco><include" + blanks + "file='a.xml'",
      "<mujoco><compiler meshdir='" + megabyte + "</mujoco>",
      "<robot name='r'><joint name='j1'/>" + blanks + "</robot>",
      "<robot name='r'><joint" + blanks + "name='j1'><limit effort='" + megabyte + "'/></joint></robot>",
      "<mujoco>" + tags + "</mujoco>",
      "<robot>" + quotes + "</robot>",
      "<mujoco" + blanks,
  };
  for (const std::string& text : texts) EXPECT_FALSE(survey(text)) << text.substr(0, 40);
}

TEST_F(ModelSurveyTest, WhatCannotBeReadIsOneSentence) {
  EXPECT_NE(survey_model("/nowhere/r.xml").error().find("/nowhere/r.xml: cannot be read"), std::string::npos);
  EXPECT_NE(survey("<mujoco>\n<nonsense/></mujoco>").error().find("nonsense"), std::string::npos);
  EXPECT_NE(survey("<mujoco><worldbody/></mujoco>").error().find("no hinge"), std::string::npos);
}

}  // namespace
}  // namespace takt::plant
