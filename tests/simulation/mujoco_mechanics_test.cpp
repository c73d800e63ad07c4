// SPDX-License-Identifier: Apache-2.0
// Goal: MuJoCo's physics stands behind the simulated drives as any other mechanics do: the same arm moves as in ours, a
// free base falls, hangs, is pushed and measured, the same inputs give the same bits; what a model lacks is said in one
// sentence. Method: models written by the test; the demo arm as MJCF against ArmDynamics; a published humanoid walking
// by its published policy where ../shared has them.
#include "simulation/mujoco_mechanics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "config/deploy_file.hpp"
#include "policy_host/onnx_policy.hpp"
#include "simulation/arm_dynamics.hpp"
#include "simulation/mjcf_file.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/arm_as_mjcf.hpp"
#include "tests/simulation/plant_robots.hpp"
#include "tests/support/files.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::simulation {
namespace {

class MujocoTest : public testing::Test {
 protected:
  ~MujocoTest() override { std::filesystem::remove(path_); }
  [[nodiscard]] config::RobotConfig robot_in(const std::string& mjcf, const std::vector<std::string>& joints) const {
    std::ofstream(path_) << mjcf;
    return robot_of(path_, joints);
  }
  static config::RobotConfig robot_of(const std::string& path, const std::vector<std::string>& joints) {
    config::RobotConfig robot = takt::test::demo_arm();
    robot.joints.resize(joints.size(), robot.joints[0]);
    for (std::size_t j = 0; j < joints.size(); ++j) robot.joints[j].name = joints[j];
    robot.simulation->mujoco = config::MujocoWorld{path, {}, {}};
    return robot;
  }
  [[nodiscard]] std::string refusal_of(const std::string& mjcf,
                                       const std::vector<std::string>& joints = {"hip"}) const {
    const auto made = MujocoMechanics::make(robot_in(mjcf, joints));
    return made ? "" : made.error();
  }

  std::string path_ = testing::TempDir() + fmt::format("takt-model-{}.xml", getpid());
};

ArmState at(std::vector<double> q) {
  const auto count = static_cast<Eigen::Index>(q.size());
  return {Eigen::Map<Eigen::VectorXd>(q.data(), count), Eigen::VectorXd::Zero(count)};
}

// A body on a free joint with one driven hinge, above a floor.
constexpr const char* kHopper = R"(<mujoco>
  <option timestep="0.0005"/>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.1 0.1 0.05" mass="2"/>
      <site name="imu"/>
      <body name="leg" pos="0.3 0 0">
        <joint name="hip" axis="0 1 0"/>
        <geom type="sphere" size="0.03" pos="0 0 -0.2" mass="0.1" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="high" qpos="0 0 5  1 0 0 0  0.5"/></keyframe>
</mujoco>)";

// Goal: the same arm in both engines. Method: the demo arm, let go and pushed by torques for half a second; both with
// steps short enough that their integrators agree.
TEST_F(MujocoTest, TheDemoArmMovesAsInOurDynamics) {
  config::RobotConfig robot = takt::test::demo_arm();
  std::vector<std::string> names;
  for (config::Joint& joint : robot.joints) {
    joint.limits.q_min = -100;  // no stops
    joint.limits.q_max = 100;
    names.push_back(joint.name);
  }
  ASSERT_EQ(robot.model->gravity, (config::Vector3{0, 0, -9.81}));
  robot.simulation->step = microseconds(100);
  config::RobotConfig same = robot;
  same.simulation->mujoco = robot_in(takt::test::arm_as_mjcf(robot), names).simulation->mujoco;
  auto ours = ArmDynamics::make(robot);
  auto theirs = MujocoMechanics::make(same);
  ASSERT_TRUE(ours) << ours.error();
  ASSERT_TRUE(theirs) << theirs.error();
  ArmState a = at({0.1, -0.4, 0.9, 0.2, 0.3, -0.2}), b = a;
  const std::vector<Friction> friction(6, Friction{0.05, 0});
  double farthest = 0;
  for (int step = 0; step < 5'000; ++step) {
    const Eigen::VectorXd tau = Eigen::VectorXd::LinSpaced(6, 2, -1) * std::sin(step * 2e-3);
    (*ours)->integrate(a, tau, friction, microseconds(100));
    (*theirs)->integrate(b, tau, friction, microseconds(100));
    farthest = std::max(farthest, (a.q - b.q).cwiseAbs().maxCoeff());
  }
  EXPECT_GT((a.q - at({0.1, -0.4, 0.9, 0.2, 0.3, -0.2}).q).norm(), 0.5) << "it moved";
  EXPECT_LT(farthest, 2e-3) << "rad";
  RecordProperty("farthest_rad", fmt::format("{:.2e}", farthest));
}

TEST_F(MujocoTest, AFreeBaseFallsAndIsHeldByTheHoist) {
  config::RobotConfig robot = robot_in(kHopper, {"hip"});
  robot.simulation->mujoco->keyframe = "high";
  auto body = MujocoMechanics::make(robot);
  ASSERT_TRUE(body) << body.error();
  EXPECT_EQ((*body)->base()->position[2], 5);
  ArmState state = at({0.5});
  const std::vector<Friction> free(1);
  (*body)->hoist(true);
  for (int step = 0; step < 200; ++step) (*body)->integrate(state, Eigen::VectorXd::Zero(1), free, milliseconds(1));
  EXPECT_EQ((*body)->base()->position[2], 5);
  EXPECT_NEAR(state.q[0], 0.5 * std::cos(std::sqrt(9.81 / 0.2) * 0.2), 0.03) << "the leg swings as from a base at rest";
  (*body)->hoist(false);
  for (int step = 0; step < 500; ++step) (*body)->integrate(state, Eigen::VectorXd::Zero(1), free, milliseconds(1));
  EXPECT_NEAR((*body)->base()->position[2], 5 - 0.5 * 9.81 * 0.25, 0.05);
}

// Goal: the IMU tells what a real one does. Method: upright on the hoist it feels 1 g upwards; in free fall nothing,
// and the rate at which it turns, in its own axes.
TEST_F(MujocoTest, TheImuFeelsSpecificForceAndItsOwnRate) {
  config::RobotConfig robot = robot_in(kHopper, {"hip"});
  EXPECT_FALSE((*MujocoMechanics::make(robot))->imu().has_value()) << "none is asked for";
  robot.simulation->mujoco->imu_site = "imu";
  auto body = MujocoMechanics::make(robot);
  ASSERT_TRUE(body) << body.error();
  ArmState state = at({0});
  const std::vector<Friction> free(1);
  for (int step = 0; step < 2'000; ++step) (*body)->integrate(state, Eigen::VectorXd::Zero(1), free, milliseconds(1));
  const auto resting = (*body)->imu();
  ASSERT_TRUE(resting);
  EXPECT_LT((*body)->base()->position[2], 0.1) << "it lies on the floor";
  EXPECT_NEAR(resting->acceleration[2], 9.81, 0.5);
  EXPECT_NEAR(std::abs(resting->orientation[0]), 1, 0.05);
  EXPECT_NEAR(resting->angular_velocity[1], 0, 0.05);

  auto falling = MujocoMechanics::make(robot);
  state = at({0});
  for (int step = 0; step < 100; ++step) (*falling)->integrate(state, Eigen::VectorXd::Zero(1), free, milliseconds(1));
  EXPECT_NEAR((*falling)->imu()->acceleration[2], 0, 0.1) << "in free fall nothing is felt";
}

TEST_F(MujocoTest, APushMovesTheRobot) {
  const config::RobotConfig robot = robot_in(kHopper, {"hip"});
  auto body = MujocoMechanics::make(robot);
  ArmState state = at({0});
  EXPECT_TRUE((*body)->push({21, 0, 0}, {}));
  for (int step = 0; step < 200; ++step)
    (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
  EXPECT_NEAR((*body)->base()->position[0], 0.5 * 10 * 0.04, 0.02) << "21 N on 2.1 kg for 0.2 s";
}

TEST_F(MujocoTest, AHeldJointStays) {
  config::RobotConfig pendulum = takt::test::pendulum(1, 0.5);
  pendulum.model->links[0].inertia = {1e-3, 1e-3, 1e-3};
  auto body = MujocoMechanics::make(robot_in(takt::test::arm_as_mjcf(pendulum), {pendulum.joints[0].name}));
  ASSERT_TRUE(body) << body.error();
  ArmState state = at({1});
  for (int step = 0; step < 1'000; ++step)
    (*body)->integrate(state, Eigen::VectorXd::Zero(1), {Friction{0, 50}}, milliseconds(1));
  EXPECT_NEAR(state.q[0], 1, 1e-3);
}

TEST_F(MujocoTest, WhatDivergesSaysSo) {
  auto body = MujocoMechanics::make(robot_in(kHopper, {"hip"}));
  ArmState state = at({0});
  EXPECT_THROW(
      {
        for (int step = 0; step < 100; ++step)
          (*body)->integrate(state, Eigen::VectorXd::Constant(1, 1e12), std::vector<Friction>(1), milliseconds(1));
      },
      std::runtime_error);
}

TEST_F(MujocoTest, WhatAModelLacksIsSaidInOneSentence) {
  EXPECT_NE(refusal_of(kHopper, {"hip", "knee"}).find("has no joint knee"), std::string::npos);
  std::string two = kHopper;
  two.erase(two.find("<keyframe>"), two.find("</keyframe>") + 11 - two.find("<keyframe>"));
  two.replace(two.find("<joint name=\"hip\""), 0, "<joint name=\"spare\" axis=\"1 0 0\"/>");
  EXPECT_NE(refusal_of(two).find("spare of the same robot"), std::string::npos) << refusal_of(two);
  std::string slide = kHopper;
  slide.replace(slide.find("name=\"hip\""), 0, "type=\"slide\" ");
  EXPECT_NE(refusal_of(slide).find("hip slides, and turns in the robot file; write `kind: slide` there"),
            std::string::npos)
      << refusal_of(slide);
  const std::string broken = refusal_of("<mujoco>\n<worldbody>\n<body nonsense=\"1\"/>\n</worldbody></mujoco>");
  EXPECT_NE(broken.find("nonsense"), std::string::npos) << broken;
  EXPECT_NE(broken.find("line 3"), std::string::npos) << "the user's own line: " << broken;
  EXPECT_NE(broken.find("take it out, or save the model as one file"), std::string::npos) << broken;
  config::RobotConfig robot = robot_in(kHopper, {"hip"});
  robot.simulation->mujoco->keyframe = "low";
  EXPECT_NE(MujocoMechanics::make(robot).error().find("has no keyframe `low`"), std::string::npos);
  robot = robot_in(kHopper, {"hip"});
  robot.simulation->mujoco->imu_site = "nose";
  EXPECT_NE(MujocoMechanics::make(robot).error().find("has no site `nose`"), std::string::npos);
  robot.simulation->mujoco->model = "/nowhere/robot.xml";
  EXPECT_NE(MujocoMechanics::make(robot).error().find("/nowhere/robot.xml: cannot be read"), std::string::npos);
}

// Goal: the model's actuators do nothing. Method: a joint at 1 rad without gravity, with a servo, one by a tendon, and
// a damper, by either integrator; it stays there, and goes on as fast as it was pushed.
TEST_F(MujocoTest, TheModelsActuatorsAreNotUsed) {
  for (const char* integrator : {"Euler", "implicit"})
    for (const char* actuator : {R"(<position joint="hip" kp="50"/>)",
                                 R"(<general tendon="cord" gainprm="40" biastype="affine" biasprm="3 -40 -4"/>)",
                                 R"(<velocity joint="hip" kv="30"/>)"}) {
      auto body = MujocoMechanics::make(
          robot_in(fmt::format(R"(<mujoco><option timestep="0.001" gravity="0 0 0" integrator="{}"/><worldbody>
  <body><joint name="hip" axis="0 1 0"/><geom type="sphere" size="0.1" pos="0 0 -1" mass="1"/></body></worldbody>
  <tendon><fixed name="cord"><joint joint="hip" coef="1"/></fixed></tendon><actuator>{}</actuator></mujoco>)",
                               integrator, actuator),
                   {"hip"}));
      ASSERT_TRUE(body) << body.error();
      ArmState state = at({1});
      for (int step = 0; step < 100; ++step)
        (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
      EXPECT_EQ(state.q[0], 1) << integrator << ": " << actuator;
      state.dq[0] = 2;
      for (int step = 0; step < 100; ++step)
        (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
      EXPECT_NEAR(state.q[0], 1.2, 1e-6) << integrator << ": " << actuator;
    }
}

// Goal: contacts that MuJoCo leaves out are no riddle. Method: a box with four corners on the floor in a model with
// room for one contact, and for one constraint.
TEST_F(MujocoTest, AModelWithoutRoomForItsContactsSaysSo) {
  for (const std::string size : {"nconmax", "njmax"}) {
    std::string small = kHopper;
    small.insert(small.find("<worldbody>"), fmt::format("<size {}=\"1\"/>", size));
    small.replace(small.find("0 0 1\">\n"), 5, "0 0 0.04");
    auto body = MujocoMechanics::make(robot_in(small, {"hip"}));
    ASSERT_TRUE(body) << body.error();
    ArmState state = at({0});
    std::string said;
    try {
      for (int step = 0; step < 10; ++step)
        (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
    } catch (const std::runtime_error& error) {
      said = error.what();
    }
    EXPECT_NE(said.find(fmt::format("put <size {}=\"100\"/> into the model", size)), std::string::npos) << said;
  }
}

// Goal: any body can be pushed, and no longer than it is. Method: the leg's sphere hangs beside the trunk, so that a
// push there turns the robot; then the trunk is pushed instead.
TEST_F(MujocoTest, APushActsAtTheBodyThatIsNamed) {
  const config::RobotConfig robot = robot_in(kHopper, {"hip"});
  auto body = MujocoMechanics::make(robot);
  EXPECT_TRUE((*body)->has_body("leg"));
  EXPECT_FALSE((*body)->has_body("wing"));
  EXPECT_FALSE((*body)->has_body("world")) << "not of the robot";
  ArmState state = at({0});
  const auto turned_by = [&](const std::string& at) {
    (*body)->push({0, 20, 0}, at);
    const std::array<double, 4> before = (*body)->base()->orientation;
    for (int step = 0; step < 50; ++step)
      (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
    const std::array<double, 4> after = (*body)->base()->orientation;
    return std::abs(after[3] - before[3]);  // about z
  };
  const double at_leg = turned_by("leg");
  EXPECT_GT(at_leg, 0.02);
  auto fresh = MujocoMechanics::make(robot);
  std::swap(*body, *fresh);
  state = at({0});
  EXPECT_LT(turned_by(""), 0.2 * at_leg);
  const double speed_before = (*body)->base()->position[1];
  (*body)->push({}, "");
  (*body)->push({}, "leg");
  for (int step = 0; step < 50; ++step)
    (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
  EXPECT_NEAR((*body)->base()->position[1] - speed_before, 0.05 * 20 * 0.05 / 2.1, 5e-3)
      << "it goes on as fast as it was";
}

// Goal: a payload at any body weighs what it weighs. Method: on the hoist a constant torque holds the leg aslant; with
// a mass at the leg it falls as fast as Newton says, with one at the trunk it stays.
TEST_F(MujocoTest, APayloadWeighsAtTheBodyThatIsNamed) {
  const config::RobotConfig robot = robot_in(kHopper, {"hip"});
  const auto falls = [&](double mass, const std::string& at_body) {
    auto body = MujocoMechanics::make(robot);
    (*body)->hoist(true);
    EXPECT_TRUE((*body)->load(mass, at_body));
    EXPECT_TRUE((*body)->load(mass, at_body)) << "the same again";
    ArmState state = at({1.2});
    const Eigen::VectorXd holding = Eigen::VectorXd::Constant(1, 0.1 * 9.81 * 0.2 * std::sin(1.2));
    for (int step = 0; step < 100; ++step)
      (*body)->integrate(state, holding, std::vector<Friction>(1), milliseconds(1));
    const double loaded = state.q[0];
    EXPECT_TRUE((*body)->load(0, {}));
    return loaded;
  };
  EXPECT_NEAR(falls(0, {}), 1.2, 5e-3) << "its own mass is held";
  EXPECT_NEAR(falls(5, "trunk"), 1.2, 5e-3) << "the trunk hangs";
  const double acceleration =
      0.3 * 9.81 * std::sin(1.2) / (0.4 * 0.2);  // of four times the mass under three times its weight
  EXPECT_NEAR(falls(0.3, "leg"), 1.2 - 0.5 * acceleration * 0.01, 0.01);
}

// Goal: ground is what the model says: a slope, and how much it rubs. Method: a box let go on a slope of 20 degrees
// stays with a friction of 1 and slides with 0.1, as far as Coulomb says.
TEST_F(MujocoTest, TerrainAndFrictionAreTheModels) {
  const auto slides = [&](double friction) {
    const std::string ground = fmt::format(
        R"(<mujoco><option timestep="0.001"/><worldbody>
  <geom type="plane" size="0 0 1" euler="0 20 0" friction="{0} 0.005 0.0001"/>
  <body name="box" pos="0 0 0.12" euler="0 20 0"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="3" friction="{0} 0.005 0.0001"/>
    <body name="lid" pos="0 0 0.1"><joint name="hip" axis="0 0 1"/><geom type="box" size="0.05 0.05 0.01" mass="0.1" contype="0" conaffinity="0"/></body>
  </body></worldbody></mujoco>)",
        friction);
    auto body = MujocoMechanics::make(robot_in(ground, {"hip"}));
    if (!body) throw std::runtime_error(body.error());
    ArmState state = at({0});
    for (int step = 0; step < 1000; ++step)
      (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1, {1, 0}), milliseconds(1));
    return (*body)->base()->position[0];
  };
  EXPECT_LT(std::abs(slides(1)), 0.03);
  const double slope = 20 * 3.14159265 / 180;
  EXPECT_NEAR(slides(0.1), 0.5 * 9.81 * (std::sin(slope) - 0.1 * std::cos(slope)) * std::cos(slope), 0.25);
}

// Goal: a robot's plant has these physics in front of nothing else. Method: the demo arm's drives, disabled and braked;
// a payload at its tool's body and at no other.
TEST_F(MujocoTest, TheWholePlantStandsOnIt) {
  config::RobotConfig robot = takt::test::demo_arm();
  std::vector<std::string> names;
  for (const config::Joint& joint : robot.joints) names.push_back(joint.name);
  robot.simulation->mujoco = robot_in(takt::test::arm_as_mjcf(robot), names).simulation->mujoco;
  auto plant = RobotPlant::make(robot);
  ASSERT_TRUE(plant) << plant.error();
  for (int step = 0; step < 500; ++step) plant->step();
  for (std::size_t j = 0; j < names.size(); ++j)
    EXPECT_NEAR(plant->state().q[static_cast<Eigen::Index>(j)], robot.joints[j].home, 1e-3) << names[j] << ": braked";
  EXPECT_FALSE(plant->imu().has_value());
  const double payload = 1;
  auto loaded = RobotPlant::make(robot, std::span(&payload, 1));
  ASSERT_TRUE(loaded) << loaded.error();
  EXPECT_TRUE(loaded->has_body(""));
  EXPECT_FALSE(loaded->has_body("wing"));
  loaded->set_trouble({.payload = payload, .pushed = {}, .loaded = {}});
  loaded->step();
}

TEST(MjcfFile, WhatNewerVersionsWriteIsMendedInPlace) {
  const MendedMjcf mended = mend_mjcf(
      "<mujoco>\n<compiler meshdir=\"meshes\"/>\n<joint name=\"a\"\n  actuatorfrcrange=\"-1 1\" range=\"0 1\"/>\n"
      "<jointactuatorfrc name=\"f\" joint=\"a\"/>\n</mujoco>",
      "/models/robot");
  EXPECT_EQ(mended.text,
            "<mujoco>\n<compiler texturedir=\"/models/robot\" autolimits=\"true\" meshdir=\"/models/robot/meshes\"/>\n"
            "<joint name=\"a\"\n range=\"0 1\"/>\n\n</mujoco>");
  ASSERT_EQ(mended.mended.size(), 3U);
  EXPECT_NE(mended.mended[0].find("first in line 3"), std::string::npos) << mended.mended[0];
  const MendedMjcf fine = mend_mjcf("<mujoco><compiler autolimits='false'/></mujoco>", "/m");
  EXPECT_TRUE(fine.mended.empty());
}

// Goal: newer words are left out by name, and what stands in a <frame> is where it would be with one. Method: a body by
// frames in each of the ways to write an orientation, and the same by hand.
TEST_F(MujocoTest, AFrameIsWhereItsContentsAre) {
  const auto made = [&](const std::string& inner) {
    return MujocoMechanics::make(
        robot_in("<mujoco><compiler angle=\"radian\"/><worldbody><body name=\"a\" pos=\"0 0 1\">"
                 "<joint name=\"hip\" axis=\"0 1 0\"/>" +
                     inner + "</body></worldbody></mujoco>",
                 {"hip"}));
  };
  const auto fall = [&](const std::string& inner) {
    auto body = made(inner);
    if (!body) throw std::runtime_error(body.error());
    ArmState state = at({0.3});
    for (int step = 0; step < 200; ++step)
      (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
    return state.q[0];
  };
  const std::string weight = R"(<geom type="box" size="0.2 0.05 0.01" mass="1"/>)";
  const double by_hand = fall(
      R"(<geom type="box" size="0.2 0.05 0.01" mass="1" pos="0 0.1 -0.5" quat="0.70710678118654757 0 0 0.70710678118654757"/>)");
  for (const char* turn : {"euler=\"0 0 1.5707963267948966\"", "axisangle=\"0 0 2 1.5707963267948966\"",
                           "xyaxes=\"0 1 0 -1 0 0\"", "quat=\"2 0 0 2\""})
    EXPECT_NEAR(
        fall(fmt::format("<frame pos=\"0 0.1 -0.2\"><frame {} pos=\"0 0 -0.3\">{}</frame></frame>", turn, weight)),
        by_hand, 1e-9)
        << turn;
  EXPECT_NEAR(
      fall(R"(<frame pos="0 0 -0.5"><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/></frame>)"),
      fall(R"(<geom type="capsule" fromto="0 0 -0.5 0.3 0 -0.5" size="0.02" mass="1"/>)"), 1e-12);
  EXPECT_THAT(fmt::format("{}", fmt::join((*made("<frame>" + weight + "</frame>"))->notes(), "; ")),
              testing::HasSubstr("1 <frame> of newer versions taken out"));
  EXPECT_THAT(made("<frame pos=\"a b c\">" + weight + "</frame>").error(), testing::HasSubstr("frame"));
  EXPECT_THAT(made(R"(<geom size="0.1" mas="1"/>)").error(), testing::HasSubstr("mas"))
      << "a mistyped word is no newer one";
}

// Goal: joints that follow another one do so in simulation, without a joint of the robot file. Method: a URDF whose
// elbow mimics the shoulder; the shoulder is turned, and feels the elbow's weight.
TEST_F(MujocoTest, AMimicFollows) {
  const std::string arm = R"(<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 -1"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hip" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="knee" type="continuous"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>MIMIC</joint></robot>)";
  const auto with = [&](const std::string& mimic) {
    std::string text = arm;
    return text.replace(text.find("MIMIC"), 5, mimic);
  };
  EXPECT_THAT(refusal_of(with("")), testing::HasSubstr("knee of the same robot"));
  auto body = MujocoMechanics::make(robot_in(with(R"(<mimic joint="hip" multiplier="-1"/>)"), {"hip"}));
  ASSERT_TRUE(body) << body.error();
  ArmState state = at({0.4});
  for (int step = 0; step < 300; ++step)
    (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
  EXPECT_NEAR(state.q[0], 0.4, 0.05) << "the lower link hangs straight down whatever the hip does";
}

// Goal: an error of MuJoCo's ends the simulation with a sentence, and asks for no key. Method: the smallest stack with
// which a model in the air can be read; the first contact overflows it.
TEST_F(MujocoTest, AnErrorOfMujocosIsThrown) {
  const auto with_stack = [&](int numbers) {
    std::string text = kHopper;
    return MujocoMechanics::make(
        robot_in(text.insert(text.find("<worldbody>"), fmt::format("<size nstack=\"{}\"/>", numbers)), {"hip"}));
  };
  int numbers = 20;
  while (numbers < 2000 && !with_stack(numbers)) numbers += 10;
  const auto body = with_stack(numbers);
  ASSERT_TRUE(body) << body.error();
  ArmState state = at({0});
  const auto fall = [&] {
    for (int step = 0; step < 2000; ++step)
      (*body)->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
  };
  EXPECT_THROW(fall(), std::runtime_error);
}

// Goal: a name that a robot file cannot have is found by what an import makes of it. Method: one joint, then two that
// would be the same.
TEST_F(MujocoTest, AJointIsFoundByWhatAnImportCallsIt) {
  const auto arm = [](const char* other) {
    return fmt::format(R"(<mujoco><worldbody><body><joint name="robot0:WRJ1"/><geom size="0.1"/>
      <body><joint name="{}"/><geom size="0.1"/></body></body></worldbody></mujoco>)",
                       other);
  };
  EXPECT_EQ(refusal_of(arm("b"), {"robot0_WRJ1", "b"}), "");
  EXPECT_THAT(refusal_of(arm("robot0/WRJ1"), {"robot0_WRJ1"}), testing::HasSubstr("has no joint robot0_WRJ1"));
}

// Goal: the usual entry of a published robot, a scene with its floor that includes the robot, loads and names its
// files' own lines. Method: the hopper as a scene and two files, one of them with what is corrected; one with a fault.
TEST_F(MujocoTest, AModelOfSeveralFilesIsOne) {
  const std::string folder = testing::TempDir() + fmt::format("takt-scene-{}/", getpid());
  std::filesystem::create_directories(folder + "parts");
  std::ofstream(folder + "parts/leg.xml")
      << "<mujocoinclude>\n<body name=\"leg\" pos=\"0 0 -0.1\">\n"
         "<joint name=\"hip\" axis=\"0 1 0\" actuatorfrcrange=\"-9 9\"/>\n"
         "<geom type=\"sphere\" size=\"0.05\" mass=\"0.2\"/>\n</body>\n</mujocoinclude>\n";
  std::ofstream(folder + "robot.xml") << "<!-- a\n<include file=\"none.xml\"/> -->\n<mujoco model=\"r\">\n<worldbody>\n"
                                         "<body name=\"trunk\" pos=\"0 0 1\"><freejoint/>\n"
                                         "<geom type=\"box\" size=\"0.1 0.1 0.1\" mass=\"2\"/>\n"
                                         "<include file=\"parts/leg.xml\"/>\n</body></worldbody></mujoco>\n";
  const std::string scene = folder + "scene.xml";
  std::ofstream(scene) << "<mujoco>\n<include file=\"robot.xml\"/>\n<worldbody>"
                          "<geom type=\"plane\" size=\"0 0 1\"/></worldbody>\n</mujoco>\n";
  const auto body = MujocoMechanics::make(robot_of(scene, {"hip"}));
  ASSERT_TRUE(body) << body.error();
  EXPECT_THAT(fmt::format("{}", fmt::join((*body)->notes(), "; ")),
              testing::HasSubstr("first in line 3 of " + folder + "parts/leg.xml"));
  std::ofstream(folder + "parts/leg.xml") << "<mujocoinclude>\n\n<body nonsense=\"1\"/></mujocoinclude>\n";
  const auto broken = MujocoMechanics::make(robot_of(scene, {"hip"}));
  ASSERT_FALSE(broken);
  EXPECT_THAT(broken.error(), testing::HasSubstr("ine 3 of " + folder + "parts/leg.xml"));
  std::filesystem::remove_all(folder);
}

// --- Unitree's G1 by its published policy ---

constexpr const char* kG1 = "../shared/robots/g1/g1_29dof.xml";
constexpr const char* kPolicy = "../shared/policies/g1_velocity/";

std::vector<std::string> g1_joints() {
  std::vector<std::string> names;
  for (const char* side : {"left", "right"})
    for (const char* joint : {"hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"})
      names.push_back(fmt::format("{}_{}_joint", side, joint));
  for (const char* joint : {"yaw", "roll", "pitch"}) names.push_back(fmt::format("waist_{}_joint", joint));
  for (const char* side : {"left", "right"})
    for (const char* joint :
         {"shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw"})
      names.push_back(fmt::format("{}_{}_joint", side, joint));
  return names;
}

struct Walk {
  double ahead = 0, height = 0;  // m, of the pelvis at the end
  std::vector<double> bits;      // the joints' angles at the end
};

// As it was trained: PD with the file's gains at 1 kHz, the network at 50 Hz, each observation five steps deep.
class G1 {
 public:
  G1() {
    const std::string text = test::text_of(std::string(kPolicy) + "deploy.yaml");
    deploy_ = config::read_deploy_file(text, "deploy.yaml").value();
    network_ = policy_host::load_onnx_policy(std::string(kPolicy) + "policy.onnx", "obs", "actions").value();
    config::RobotConfig robot = takt::test::demo_arm();
    const auto names = g1_joints();
    robot.joints.resize(names.size(), robot.joints[0]);
    for (std::size_t j = 0; j < names.size(); ++j) robot.joints[j].name = names[j];
    robot.simulation->mujoco = config::MujocoWorld{kG1, {}, "imu"};
    robot.simulation->step = milliseconds(1);
    body_ = MujocoMechanics::make(robot).value();
    for (std::size_t i = 0; i < 29; ++i) home_.at(motor(i)) = deploy_.default_position[i];
  }

  Walk walk(Duration lasting, Duration frozen_from) {
    ArmState state = at(home_);
    std::vector<double> target = home_, last(29);
    std::vector<std::vector<double>> past;
    for (int step = 0; step < lasting.ns / 1'000'000; ++step) {
      if (step % 20 == 0 && milliseconds(step) < frozen_from) {
        observe(state, last, past);
        std::vector<float> input, output(29);
        for (std::size_t term = 0, from = 0; term < 6; from += width(term++))
          for (const auto& then : past)
            for (std::size_t i = 0; i < width(term); ++i) input.push_back(static_cast<float>(then[from + i]));
        network_->infer(input, output);
        for (std::size_t i = 0; i < 29; ++i) {
          last[i] = static_cast<double>(output[i]);
          target.at(motor(i)) = deploy_.default_position[i] + 0.25 * last[i];
        }
      }
      Eigen::VectorXd tau(29);
      for (std::size_t j = 0; j < 29; ++j) {
        const auto i = static_cast<Eigen::Index>(j);
        tau[i] = std::clamp(deploy_.stiffness[j] * (target[j] - state.q[i]) - deploy_.damping[j] * state.dq[i],
                            -kTorque, kTorque);
      }
      body_->integrate(state, tau, std::vector<Friction>(29), milliseconds(1));
    }
    const auto base = *body_->base();
    return {base.position[0], base.position[2], {state.q.begin(), state.q.end()}};
  }

 private:
  static constexpr double kTorque = 139;  // Nm
  static std::size_t width(std::size_t term) { return term < 3 ? 3 : 29; }
  [[nodiscard]] std::size_t motor(std::size_t i) const { return deploy_.robot_joint[i]; }

  void observe(const ArmState& state, const std::vector<double>& last, std::vector<std::vector<double>>& past) {
    const ImuReading imu = *body_->imu();
    const auto [w, x, y, z] = imu.orientation;
    std::vector<double> now;
    for (const double rate : imu.angular_velocity) now.push_back(0.2 * rate);
    now.insert(now.end(), {-2 * (x * z - w * y), -2 * (y * z + w * x), -(1 - 2 * (x * x + y * y))});
    now.insert(now.end(), {0.5, 0, 0});  // m/s ahead
    for (std::size_t i = 0; i < 29; ++i)
      now.push_back(state.q[static_cast<Eigen::Index>(motor(i))] - deploy_.default_position[i]);
    for (std::size_t i = 0; i < 29; ++i) now.push_back(0.05 * state.dq[static_cast<Eigen::Index>(motor(i))]);
    now.insert(now.end(), last.begin(), last.end());
    if (past.empty()) past.assign(5, now);
    past.erase(past.begin());
    past.push_back(now);
  }

  config::DeployFile deploy_;
  std::unique_ptr<policy_host::Policy> network_;
  std::unique_ptr<MujocoMechanics> body_;
  std::vector<double> home_ = std::vector<double>(29);
};

// Goal: a published robot walks in our simulator by its published policy. Method: both files as they were
// published (the model with what MuJoCo 2.2.2 does not know); 0.5 m/s commanded for ten seconds; the same again gives
// the same bits.
TEST(G1InMujoco, WalksByItsPublishedPolicyAndFallsWithoutIt) {
  TAKT_NEEDS_SHARED(kG1, std::string(kPolicy) + "policy.onnx");
  const Walk walk = G1().walk(seconds(10), seconds(100));
  EXPECT_GT(walk.ahead, 4.0) << "m in ten seconds";
  EXPECT_GT(walk.height, 0.7) << "m: it stands";
  EXPECT_EQ(G1().walk(seconds(10), seconds(100)).bits, walk.bits);
  EXPECT_LT(G1().walk(seconds(8), seconds(4)).height, 0.5) << "a policy frozen for ever: it falls";
  RecordProperty("ahead_m", fmt::format("{:.2f}", walk.ahead));
}

}  // namespace
}  // namespace takt::simulation
