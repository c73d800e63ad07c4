// SPDX-License-Identifier: Apache-2.0
// Goal: the rigid bodies that a robot file gets of a published model weigh what the model weighs, wherever its joints
// stand. Method: models of tilted and shifted frames, branches, slides, two joints of one body, references other than
// zero, products of inertia and bodies that no drive moves become robot files; the tick's gravity and the simulated
// arm's inertia are compared with MuJoCo's own in poses drawn at random.
#include "simulation/rigid_bodies.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "config/load.hpp"
#include "config/model_import.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "simulation/arm_dynamics.hpp"
#include "simulation/model_survey.hpp"
#include "simulation/mujoco_model.hpp"

namespace takt::simulation {
namespace {

constexpr const char* kPolicy =
    "\npolicy:\n  file: hand.py\n  period: 20 ms\n  step_period: 20 ms\n  steps: 10\n"
    "  observation: [{ term: joint_position }]\n";

// A trunk that carries an arm and a lift, every frame tilted.
constexpr const char* kTree = R"(<mujoco><compiler angle="radian"/><option gravity="1 -2 -9"/><worldbody>
  <body name="trunk" pos="0.1 0.2 0.3" euler="0.3 -0.4 0.5">
    <joint name="turn" axis="0.2 0.1 1" pos="0.03 -0.02 0.01" range="-2 2" ref="0.4"/>
    <joint name="tip" axis="0 1 0.3" pos="-0.05 0.04 0.02" range="-1 1"/>
    <geom type="box" size="0.1 0.05 0.2" pos="0.05 0.02 0.1" euler="0.2 0.3 0.4" mass="3"/>
    <body name="upper" pos="0.1 0 0.4" euler="-0.3 0.2 0.1">
      <joint name="shoulder" axis="1 0 0" range="-2 2"/>
      <geom type="capsule" fromto="0 0 0 0.3 0.1 -0.05" size="0.03" mass="1.2"/>
      <body name="plate" pos="0.2 0.1 0" euler="0.5 0 0"><geom type="box" size="0.05 0.02 0.03" mass="0.4"/></body>
      <body name="fore" pos="0.3 0.1 -0.05" euler="0.1 0.7 -0.2">
        <joint name="elbow" axis="0 -1 0.2" pos="0.01 0 0" range="-2 2"/>
        <geom type="capsule" fromto="0 0 0 0.2 -0.1 0.1" size="0.02" mass="0.7"/>
      </body>
    </body>
    <body name="lift" pos="-0.1 0 0.4" euler="0.2 0.2 0.2">
      <joint name="lift" type="slide" axis="0.3 0 1" range="-0.2 0.5"/>
      <geom type="box" size="0.1 0.02 0.03" pos="0.02 0.01 0" mass="0.9"/>
      <body name="led" pos="0 0 0.1"><joint name="led" type="slide" axis="0 1 0" range="0 0.1"/><geom type="sphere" size="0.03" mass="0.3"/></body>
      <body name="wheel" pos="0.1 0 0.1"><joint name="wheel" axis="0 1 0" range="-3 3"/><geom type="cylinder" size="0.05 0.01" pos="0.01 0 0" mass="0.2"/></body>
    </body>
  </body></worldbody>
  <equality><joint joint1="led" joint2="lift"/></equality>
  <actuator><motor joint="turn"/><motor joint="tip"/><motor joint="shoulder"/><motor joint="elbow"/><motor joint="lift"/><motor joint="wheel"/></actuator>
</mujoco>)";

constexpr const char* kChain = R"(<robot name="chain"><link name="base"/>
  <link name="a"><inertial><origin xyz="0.1 0.02 0.03" rpy="0.2 0.3 0.4"/><mass value="1.5"/><inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.004" ixz="-0.003" iyz="0.002"/></inertial></link>
  <link name="b"><inertial><origin xyz="0.05 -0.03 0.1"/><mass value="0.8"/><inertia ixx="0.01" iyy="0.012" izz="0.006" ixy="-0.001" ixz="0.002" iyz="0.001"/></inertial></link>
  <joint name="first" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0.1 0.2" rpy="0.3 0.1 -0.4"/><axis xyz="0 1 0.5"/><limit lower="-2" upper="2" effort="30" velocity="2"/></joint>
  <joint name="second" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0.1" rpy="-0.7 0.5 0.2"/><axis xyz="1 0.2 0"/><limit lower="-2" upper="2" effort="30" velocity="2"/></joint></robot>)";

class RigidBodies : public testing::Test {
 protected:
  ~RigidBodies() override { std::filesystem::remove(path_); }
  void take(const std::string& model) {
    std::ofstream(path_) << model;
    auto loaded = load_model(config::read_model_text(path_).value());
    ASSERT_TRUE(loaded) << loaded.error();
    model_ = std::move(loaded->model);
    data_.reset(mj_makeData(model_.get()));
  }
  // What `takt config new MODEL --simulated` writes, with a policy.
  config::RobotConfig robot() {
    const auto facts = survey_model(path_).value();
    std::vector<std::string> joints;
    for (const config::ModelJoint& joint : facts.joints) joints.push_back(joint.name);
    const std::string text = config::robot_of_model({.robot = "bodies",
                                                     .policy_file = {},
                                                     .joint_names = {},
                                                     .source = "bodies.xml",
                                                     .model = facts,
                                                     .model_file = path_,
                                                     .bodies = rigid_bodies(path_, {}, joints).value(),
                                                     .simulated = true})
                                 .value();
    auto parsed = config::parse(text + kPolicy, "bodies.yaml");
    EXPECT_TRUE(parsed) << parsed.error() << text;
    return *parsed;
  }
  // Draws a pose for the robot's joints; in MuJoCo every other joint stands at zero.
  std::vector<double> drawn_pose(const config::RobotConfig& robot) {
    mj_resetData(model_.get(), data_.get());
    std::ranges::fill(std::span(data_->qpos, static_cast<std::size_t>(model_->nq)), 0);
    std::vector<double> pose;
    for (const config::Joint& joint : robot.joints) {
      pose.push_back(std::uniform_real_distribution(joint.limits.q_min, joint.limits.q_max)(random_));
      data_->qpos[model_->jnt_qposadr[id_of(joint.name)]] = pose.back();
    }
    mj_forward(model_.get(), data_.get());
    return pose;
  }
  [[nodiscard]] int id_of(const std::string& joint) const {
    return mj_name2id(model_.get(), mjOBJ_JOINT, joint.c_str());
  }
  [[nodiscard]] int dof_of(const std::string& joint) const { return model_->jnt_dofadr[id_of(joint)]; }
  std::string path_ = testing::TempDir() + fmt::format("takt-bodies-{}.xml", getpid());
  std::unique_ptr<mjModel, DeleteModel> model_;
  std::unique_ptr<mjData, DeleteData> data_;
  std::mt19937 random_{5};
};

TEST_F(RigidBodies, WeighWhatTheModelWeighsInEveryPose) {
  for (const char* model : {kTree, kChain}) {
    take(model);
    const config::RobotConfig robot = this->robot();
    ASSERT_TRUE(robot.model);
    const auto tick = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 0));
    const pipeline::GravityModel gravity(*tick);
    for (int time = 0; time < 50; ++time) {
      const std::vector<double> pose = drawn_pose(robot);
      const std::vector<float> q(pose.begin(), pose.end());
      std::vector<float> torques(q.size());
      gravity.torques(q, torques);
      for (std::size_t i = 0; i < robot.joints.size(); ++i)
        EXPECT_NEAR(torques[i], data_->qfrc_bias[dof_of(robot.joints[i].name)], 2e-3) << robot.joints[i].name;
    }
  }
}

TEST_F(RigidBodies, TurnAsTheModelTurns) {
  take(kChain);
  const config::RobotConfig robot = this->robot();
  const auto arm = ArmDynamics::make(robot).value();
  for (int time = 0; time < 20; ++time) {
    const std::vector<double> pose = drawn_pose(robot);
    Eigen::MatrixXd ours = arm->inertia(Eigen::Map<const Eigen::VectorXd>(pose.data(), 2)), theirs(2, 2);
    for (int i = 0; i < 2; ++i) ours(i, i) -= robot.joints[static_cast<std::size_t>(i)].inertia;  // the rotors'
    mj_fullM(model_.get(), theirs.data(), data_->qM);
    EXPECT_TRUE(ours.isApprox(theirs, 1e-4)) << ours << "\n" << theirs;
  }
}

// Goal: nothing is said of a robot whose weight depends on more than its joints. Method: a free base, and a ball.
TEST_F(RigidBodies, AreNotWrittenOfABaseThatMoves) {
  for (const char* joint : {"<freejoint/>", "<joint type=\"ball\"/>"}) {
    take(fmt::format(R"(<mujoco><worldbody><body name="trunk">{}<geom size="0.1"/><body name="leg">
      <joint name="hip" range="-60 60"/><geom size="0.1" pos="0.2 0 0"/></body></body></worldbody></mujoco>)",
                     joint));
    EXPECT_FALSE(rigid_bodies(path_, {}, {"hip"}).value()) << joint;
    EXPECT_FALSE(robot().model);
  }
  take(kChain);
  EXPECT_FALSE(rigid_bodies(path_, {}, {"second", "first"}).value()) << "a link stands before the one that carries it";
  EXPECT_TRUE(rigid_bodies(path_, {}, {"second"}).value()) << "what no joint moves is the base's";
}

}  // namespace
}  // namespace takt::simulation
