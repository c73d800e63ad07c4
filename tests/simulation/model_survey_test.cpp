// SPDX-License-Identifier: Apache-2.0
// Goal: what a published model says of joints is read as it means it. Method: a small MJCF and URDF written by the
// test, each fact by each of its spellings; what cannot be read is one sentence.
#include "simulation/model_survey.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "simulation/mjcf_newer.hpp"

namespace takt::simulation {
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

// In the form of newer MuJoCo versions, with another object beside the robot, and a gripper of two fingers.
constexpr const char* kFramed = R"(<mujoco>
  <compiler angle="radian" assetdir="none"/>
  <option integrator="implicitfast" ls_iterations="9"><flag eulerdamp="disable"/></option>
  <default><default class="soft"><geom solimp="0.9 0.9 0.01"/></default></default>
  <worldbody>
    <frame pos="0 0 1" euler="0 0 1.5707963267948966">
      <body name="arm" gravcomp="1"><joint name="arm/hip:1" axis="1 0 0" range="-1 1" actuatorfrcrange="-5 5"/><geom size="0.05" mass="1"/>
        <frame childclass="soft" pos="0.1 0 0">
          <body><joint name="finger" type="slide" range="0 0.04"/><geom size="0.01" mass="0.1"/></body>
          <body><joint name="finger2" type="slide" range="0 0.04"/><geom size="0.01" mass="0.1"/></body>
        </frame>
      </body>
    </frame>
    <body name="box" pos="2 0 0"><freejoint align="false"/><geom size="0.1" mass="1"/>
      <body><joint name="lid"/><geom size="0.1" mass="0.1"/></body></body>
  </worldbody>
  <equality><joint joint1="finger2" joint2="finger"/></equality>
  <actuator><position joint="arm/hip:1" kp="50" dampratio="1" inheritrange="1"/></actuator>
  <sensor><contact name="c"/></sensor>
</mujoco>)";

constexpr const char* kFollowing = R"(<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 -1"/><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/upper.dae"/></geometry></visual></link>
  <link name="lower"><inertial><origin xyz="0 0 -1"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="40" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 -1"/><axis xyz="0 1 0"/>
    <limit lower="-4" upper="4" effort="40" velocity="3"/><mimic joint="shoulder" multiplier="-2" offset="0.25"/></joint></robot>)";

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

// Goal: nothing in a model moves the cursor of who imports it. Method: names with an escape sequence, in a remark and
// in a refusal.
TEST_F(ModelSurveyTest, NothingInAModelMovesTheCursor) {
  const auto named = [](std::string text) {
    for (std::size_t at = 0; (at = text.find("\"elbow\"", at)) != std::string::npos;) text.insert(at + 1, "\x1b[2J");
    return text;
  };
  const auto facts = survey(named(kFollowing));
  ASSERT_TRUE(facts) << facts.error();
  ASSERT_FALSE(facts->remarks.empty());
  for (const std::string& remark : facts->remarks) EXPECT_EQ(remark.find('\x1b'), std::string::npos) << remark;
  EXPECT_NE(facts->remarks.front().find("\\x1b[2Jelbow"), std::string::npos) << facts->remarks.front();
  const auto refused = survey("<mujoco><include file=\"\x1b[2J.xml\"/></mujoco>");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().find('\x1b'), std::string::npos) << refused.error();
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
// Threat: model-file
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

// Goal: a model that would fill memory or take long is refused in a line. Method: a composite of eight million bodies.
TEST_F(ModelSurveyTest, AModelWithoutBoundsIsRefused) {
  const auto facts = survey(R"(<mujoco><worldbody><body><joint name="a"/><geom size="0.1"/>
    <composite type="particle" count="200 200 200" spacing="0.05"><geom size="0.02"/></composite></body></worldbody></mujoco>)");
  ASSERT_FALSE(facts);
  EXPECT_EQ(facts.error().find('\n'), std::string::npos) << facts.error();
  EXPECT_TRUE(facts.error().starts_with(path_ + ": ")) << facts.error();
}

// Goal: whatever a text of a model holds, an import goes on: facts, or one line. Method: small models of both formats,
// with bytes, words, lines and whole pieces changed; TAKT_MODEL_MUTATIONS says how many, 1000 by itself.
TEST_F(ModelSurveyTest, AMutatedModelIsReadOrRefusedInALine) {
  const char* const wanted = std::getenv("TAKT_MODEL_MUTATIONS");
  const int count = wanted != nullptr ? std::atoi(wanted) : 1000;
  const std::string texts[] = {kRobot, kFramed, kFollowing};
  const char* const words[] = {"-1",
                               "0",
                               "1e300",
                               "nan",
                               "",
                               "<",
                               ">",
                               "\"",
                               "/>",
                               "</body>",
                               "<frame pos=\"1 0 0\">",
                               "<include file=\"x\"/>",
                               "999999999"};
  std::mt19937 random(7);
  const auto below = [&](std::size_t end) { return std::uniform_int_distribution<std::size_t>(0, end - 1)(random); };
  int read = 0;
  for (int i = 0; i < count; ++i) {
    std::string text = texts[below(std::size(texts))];
    for (std::size_t change = 0; change <= below(3); ++change) {
      const std::size_t at = below(text.size()), length = std::min(below(40) + 1, text.size() - at);
      switch (below(4)) {
        case 0:
          text[at] = static_cast<char>(below(256));
          break;
        case 1:
          text.erase(at, length);
          break;
        case 2:
          text.insert(at, words[below(std::size(words))]);
          break;
        default:
          text.insert(below(text.size()), text.substr(at, length));
      }
      if (text.empty()) text = " ";
    }
    const auto facts = survey(text);
    read += facts ? 1 : 0;
    if (!facts) {
      ASSERT_EQ(facts.error().find('\n'), std::string::npos) << i << ": " << facts.error() << "\n" << text;
    }
  }
  EXPECT_GT(read, count / 50) << "the models are still models";
  RecordProperty("read", read);
}

// Goal: what has an equality or a <mimic> follows in simulation and gets no drive, other objects' joints are not the
// robot's, and a gripper's second finger follows the first. Method: an MJCF with each of them, a URDF with a mimic.
TEST_F(ModelSurveyTest, WhatNoDriveMovesIsNamed) {
  const auto facts = survey(kFramed);
  ASSERT_TRUE(facts) << facts.error();
  ASSERT_EQ(facts->joints.size(), 2U);
  EXPECT_EQ(facts->joints[0].name, "arm/hip:1");
  EXPECT_EQ(facts->joints[0].kind, config::JointKind::hinge);
  EXPECT_EQ(facts->joints[1].name, "finger");
  EXPECT_EQ(facts->joints[1].kind, config::JointKind::slide);
  const std::string remarks = fmt::format("{}", fmt::join(facts->remarks, "\n"));
  EXPECT_NE(remarks.find("other objects than the robot are not the robot's: lid"), std::string::npos) << remarks;
  EXPECT_NE(remarks.find("follow another one have no drive of their own: finger2"), std::string::npos) << remarks;
  const auto followed = survey(kFollowing);
  ASSERT_TRUE(followed) << followed.error();
  ASSERT_EQ(followed->joints.size(), 1U);
  EXPECT_EQ(followed->joints[0].name, "shoulder");
  EXPECT_NE(fmt::format("{}", fmt::join(followed->remarks, "\n")).find("no drive of their own: elbow"),
            std::string::npos);
}

// Goal: what MuJoCo learned since 2.2.2 and a robot's drives do not need hinders no import, each kind is named, and an
// actuator of a new kind keeps its place among the motors. Method: one model with all of them, as of 2026.
constexpr const char* kOf2026 = R"(<mujoco>
  <extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="4"/></instance></plugin></extension>
  <compiler conflict="merge"/>
  <option><flag ipc="enable"/></option>
  <default><dcmotor saturation="3"/><default class="d"><pid kp="3"/></default></default>
  <asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 1 0"/></asset>
  <worldbody>
    <light softness="0.1"/>
    <flexcomp name="cloth" type="grid" count="3 3 1" dim="2"><edge equality="true"/><pin id="0"/></flexcomp>
    <body name="arm" simple="true"><joint name="a" axis="1 0 0"/><geom size="0.05" mass="1" surfacevel="0 0 1" adhesion="2"/>
      <site name="s" type="mesh" mesh="m"/><plugin plugin="p.q"/>
      <body pos="1 0 0"><joint name="b" axis="1 0 0"/><geom size="0.05" mass="1"/>
        <body pos="1 0 0"><joint name="c" axis="1 0 0"/><geom size="0.05" mass="1"/></body></body></body>
  </worldbody>
  <deformable><flex name="f" dim="1"><contact condim="3"/></flex></deformable>
  <equality><flexstrain flex="f"/></equality>
  <actuator>
    <dcmotor name="1" joint="c" resistance="2" ctrlrange="-3 3" input="voltage"/>
    <plugin joint="a" plugin="mujoco.pid" instance="p"><config key="k" value="1"/></plugin>
    <pid joint="b" kp="3" ki="1"/>
    <orientation joint="a" kp="3"/>
  </actuator>
  <sensor><gyro site="s" delay="0.01"/><plugin plugin="x.y"><config key="k" value="1"/></plugin></sensor>
</mujoco>)";

TEST_F(ModelSurveyTest, WhatNewerVersionsKnowIsLeftOutByName) {
  const auto facts = survey(kOf2026);
  ASSERT_TRUE(facts) << facts.error();
  EXPECT_EQ(facts->joints.size(), 3U);
  EXPECT_EQ(facts->motors, (std::vector<std::string>{"c", "a", "b"}));
  std::string text = kOf2026;
  const std::string remarks = fmt::format("{}", fmt::join(leave_out_newer(text), "\n"));
  for (const char* const what : {"element extension left out",
                                 "conflict of compiler",
                                 "ipc of flag",
                                 "element dcmotor left out",
                                 "element pid left out",
                                 "elevation of hfield",
                                 "softness of light",
                                 "element flexcomp left out",
                                 "simple of body",
                                 "surfacevel of geom",
                                 "adhesion of geom",
                                 "mesh of site",
                                 "mesh of type taken as sphere",
                                 "element plugin left out, 2 times",
                                 "element deformable",
                                 "element flexstrain",
                                 "dcmotor of actuator taken as motor",
                                 "plugin of actuator taken as motor",
                                 "pid of actuator taken as motor",
                                 "element orientation",
                                 "delay of gyro",
                                 "resistance of dcmotor"})
    EXPECT_NE(remarks.find(what), std::string::npos) << what << '\n' << remarks;
}

// Goal: looking for what closes an element takes no longer than the text is. Method: many that nothing closes.
TEST_F(ModelSurveyTest, ElementsThatNothingClosesAreRefusedInTime) {
  std::string text = "<mujoco>";
  for (int i = 0; i < 100'000; ++i) text += "<plugin>";
  EXPECT_FALSE(survey(text));
}

// Goal: a URDF's link between two joints needs no mass, and one at the end that has none is named. Method: a wrist
// whose tool is fixed to a bare link; the same without the tool.
TEST_F(ModelSurveyTest, AUrdfsLinksMayLackAMass) {
  const std::string robot = R"(<robot name="arm"><link name="base"/><link name="wrist"/>
    <joint name="turn" type="revolute"><parent link="base"/><child link="wrist"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="2" effort="40" velocity="3"/></joint>)";
  const std::string tool = R"(<link name="tool"><inertial><origin xyz="0 0 -1"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="fix" type="fixed"><parent link="wrist"/><child link="tool"/></joint>)";
  const auto with_tool = survey(robot + tool + "</robot>");
  ASSERT_TRUE(with_tool) << with_tool.error();
  EXPECT_NEAR(with_tool->joints.at(0).inertia, 2.01, 1e-4);
  EXPECT_TRUE(with_tool->remarks.empty()) << with_tool->remarks.front();
  // A follower makes MuJoCo read again what it wrote.
  const std::string follower = R"(<link name="finger"><inertial><mass value="0.1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="close" type="revolute"><parent link="base"/><child link="finger"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="2" effort="40" velocity="3"/><mimic joint="turn"/></joint></robot>)";
  const auto followed = survey(robot + tool + follower);
  ASSERT_TRUE(followed) << followed.error();
  EXPECT_NEAR(followed->joints.at(0).inertia, 2.01, 0.02);
  const auto bare = survey(robot + "</robot>");
  ASSERT_TRUE(bare) << bare.error();
  ASSERT_EQ(bare->remarks.size(), 1U);
  EXPECT_EQ(bare->remarks.front(), "link wrist has no mass: taken as 1e-06 kg; write its inertial");
}

TEST_F(ModelSurveyTest, ARangeThatEndsBelowItsBeginningIsRefused) {
  std::string text = kFollowing;
  text.replace(text.find("lower=\"-1\""), 10, "lower=\"9\"");
  const auto facts = survey(text);
  ASSERT_FALSE(facts);
  EXPECT_NE(facts.error().find("joint shoulder has its lower limit 9 above its upper one 2"), std::string::npos)
      << facts.error();
}

// Goal: meshes that nothing depends on are done without, others are refused by name, and all are found under a folder
// that is given. Method: an MJCF whose mesh is not there, seen only, and then collided with.
TEST_F(ModelSurveyTest, AMeshThatIsOnlySeenIsNotNeeded) {
  const auto arm = [](const char* contact) {
    return fmt::format(R"(<mujoco><asset><mesh name="skin" file="skin.stl"/></asset><worldbody><body><joint name="hip"/>
    <inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/>
    <geom type="mesh" mesh="skin"{}/></body></worldbody></mujoco>)",
                       contact);
  };
  const auto seen = survey(arm(R"( contype="0" conaffinity="0")"));
  ASSERT_TRUE(seen) << seen.error();
  EXPECT_NEAR(seen->joints[0].inertia, 0.1, 1e-9);
  const auto solid = survey(arm(""));
  ASSERT_FALSE(solid);
  EXPECT_NE(solid.error().find("its meshes skin.stl are not there, and robots collide or weigh by them"),
            std::string::npos)
      << solid.error();
  const std::filesystem::path folder = testing::TempDir() + fmt::format("takt-meshes-{}", getpid());
  write_mesh(folder / "skin.stl");
  const auto found = survey_model(path_, folder.string());
  EXPECT_TRUE(found) << found.error();
  const auto copy = model_with_whole_paths(path_, folder.string());
  ASSERT_TRUE(copy);
  EXPECT_TRUE(survey(*copy)) << *copy;
  std::filesystem::remove_all(folder);
}

TEST_F(ModelSurveyTest, WhatCannotBeReadIsOneSentence) {
  EXPECT_NE(survey_model("/nowhere/r.xml").error().find("/nowhere/r.xml: cannot be read"), std::string::npos);
  EXPECT_NE(survey("<mujoco>\n<nonsense/></mujoco>").error().find("nonsense"), std::string::npos);
  EXPECT_NE(survey("<mujoco><worldbody/></mujoco>").error().find("no hinge"), std::string::npos);
}

}  // namespace
}  // namespace takt::simulation
