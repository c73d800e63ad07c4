// SPDX-License-Identifier: Apache-2.0
// Goal: a parallel gripper's slide is a joint like any other, from its model to motion. Method: an arm with a gripper
// of two coupled fingers, as MJCF and as URDF, becomes a robot file by `takt config new`'s own code; tick, drivers,
// simulated drives and MuJoCo run it in virtual time, and the simulator's own state says where the fingers are. The
// plants without MuJoCo are judged against what a force does to a mass.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "config/load.hpp"
#include "config/model_import.hpp"
#include "simulation/arm_dynamics.hpp"
#include "simulation/free_inertias.hpp"
#include "simulation/model_survey.hpp"
#include "simulation/mujoco_mechanics.hpp"
#include "simulation/plant.hpp"
#include "tests/simulation/plant_robots.hpp"
#include "tests/simulation/whole_loop.hpp"

namespace takt::simulation {
namespace {

constexpr double kCube = 0.015;  // m, half its width

// Two joints about upright axes, and a gripper at the end, around a cube that stands on a shelf.
constexpr const char* kArm = R"(<mujoco>
  <worldbody>
    <geom name="shelf" type="box" size="0.05 0.05 0.01" pos="0.5 0 0.46"/>
    <body name="cube" pos="0.5 0 0.485"><freejoint/><geom type="box" size="0.015 0.015 0.015" mass="0.05" solref="0.004 1" solimp="0.99 0.999 0.001"/></body>
    <body name="upper" pos="0 0 0.5">
      <joint name="shoulder" axis="0 0 1" range="-90 90" armature="0.02"/>
      <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.02" mass="1"/>
      <body name="hand" pos="0.25 0 0">
        <joint name="wrist" axis="0 0 1" range="-90 90" armature="0.02"/>
        <geom type="capsule" fromto="0 0 0 0.15 0 0" size="0.02" mass="0.5"/>
        <body name="left" pos="0.25 0 0">
          <joint name="finger_left" type="slide" axis="0 1 0" range="0 0.04" armature="0.1"/>
          <geom type="box" size="0.02 0.002 0.02" pos="0 0.002 0" mass="0.03"/>
        </body>
        <body name="right" pos="0.25 0 0">
          <joint name="finger_right" type="slide" axis="0 -1 0" range="0 0.04"/>
          <geom type="box" size="0.02 0.002 0.02" pos="0 -0.002 0" mass="0.03"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="finger_right" joint2="finger_left"/></equality>
  <actuator>
    <motor joint="shoulder" ctrlrange="-20 20"/><motor joint="wrist" ctrlrange="-10 10"/>
    <position joint="finger_left" kp="200" ctrlrange="0 0.04" forcerange="-25 25"/>
  </actuator>
  <keyframe><key name="home" qpos="0.5 0 0.485 1 0 0 0 0 0 0.03 0.03"/></keyframe>
</mujoco>)";

constexpr const char* kUrdf = R"(<robot name="gripper"><link name="base"/>
  <link name="hand"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="left"><inertial><mass value="0.2"/><inertia ixx="0.0001" iyy="0.0001" izz="0.0001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="right"><inertial><mass value="0.2"/><inertia ixx="0.0001" iyy="0.0001" izz="0.0001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="wrist" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
  <joint name="finger_left" type="prismatic"><parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="25" velocity="0.15"/></joint>
  <joint name="finger_right" type="prismatic"><parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="25" velocity="0.15"/><mimic joint="finger_left"/></joint></robot>)";

constexpr const char* kPolicy =
    "\npolicy:\n  file: hand.py\n  period: 20 ms\n  step_period: 20 ms\n  steps: 10\n"
    "  observation: [{ term: joint_position }]\n";

class GripperTest : public testing::Test {
 protected:
  ~GripperTest() override { std::filesystem::remove(model_); }
  // What `takt config new MODEL --simulated` writes, with a policy.
  config::RobotConfig robot_of(const std::string& model) {
    std::ofstream(model_) << model;
    const auto facts = survey_model(model_);
    if (!facts) throw std::runtime_error(facts.error());
    text_ = config::robot_of_model({.robot = "gripper",
                                    .policy_file = {},
                                    .joint_names = {},
                                    .source = "gripper.xml",
                                    .model = *facts,
                                    .model_file = model_,
                                    .simulated = true})
                .value() +
            kPolicy;
    auto robot = config::parse(text_, "gripper.yaml");
    if (!robot) throw std::runtime_error(robot.error() + "\n" + text_);
    return *robot;
  }
  std::string model_ = testing::TempDir() + fmt::format("takt-gripper-{}.xml", getpid());
  std::string text_;
};

Plant plant_of(const config::RobotConfig& robot) {
  auto mechanics = MujocoMechanics::make(robot);
  if (!mechanics) throw std::runtime_error(mechanics.error());
  return Plant::make(robot, std::move(*mechanics)).value();
}

TEST_F(GripperTest, ItsModelMakesARobotFileWithoutAnEdit) {
  for (const auto& [model, finger, joints] : {std::tuple{kArm, 2U, 3U}, std::tuple{kUrdf, 1U, 2U}}) {
    const config::RobotConfig robot = robot_of(model);
    EXPECT_THAT(text_, testing::Not(testing::HasSubstr("FILL_IN")));
    ASSERT_EQ(robot.joints.size(), joints) << "the other finger follows, and has no drive";
    const config::Joint& slide = robot.joints[finger];
    EXPECT_EQ(slide.name, "finger_left");
    EXPECT_EQ(slide.kind, config::JointKind::slide);
    EXPECT_EQ(robot.joints[0].kind, config::JointKind::hinge);
    EXPECT_EQ(slide.limits.q_min, 0);
    EXPECT_EQ(slide.limits.q_max, 0.04);
    EXPECT_EQ(slide.limits.torque, 25) << "N";
    EXPECT_LT(slide.inertia, 0.6) << "kg";
    EXPECT_LE(slide.limits.velocity_hard * slide.drive.gear_ratio, slide.drive.velocity_range);
    const auto made = MujocoMechanics::make(robot);
    ASSERT_TRUE(made) << made.error();
    for (const std::string& note : (*made)->notes())
      EXPECT_THAT(note, testing::Not(testing::HasSubstr("moves freely")));
  }
  EXPECT_THAT(text_, testing::HasSubstr("velocity: 0.15 m/s")) << "the URDF's own";
}

// Goal: it closes when told to, and holds what is between its fingers, both of them.
TEST_F(GripperTest, ClosesOnCommandAndHolds) {
  const config::RobotConfig robot = robot_of(kArm);
  Plant plant = plant_of(robot);
  test::WholeLoop loop(robot, plant);
  ASSERT_NEAR(loop.pose[2], 0.03, 1e-6) << "where the model begins";
  ASSERT_TRUE(loop.arm()) << loop.blockers();
  loop.pose[2] = 0.04F;
  loop.run(1000);
  EXPECT_EQ(loop.mode(), Mode::tracking);
  EXPECT_NEAR(plant.state().q[2], 0.04, 5e-4) << "open";
  loop.pose[2] = 0;
  double fastest = 0;
  for (int i = 0; i < 2000; ++i) {
    loop.tick();
    fastest = std::max(fastest, std::abs(plant.state().dq[2]));
  }
  EXPECT_EQ(loop.mode(), Mode::tracking);
  EXPECT_LE(fastest, robot.joints[2].limits.velocity_hard);
  EXPECT_GT(fastest, 0.02) << "it moved";
  EXPECT_NEAR(plant.state().q[2], kCube, 2e-3) << "the cube is between the fingers: one finger alone would push it off";
  EXPECT_LT(loop.joint(2).feedback.tau, -1) << "N, held";
  EXPECT_GE(loop.joint(2).feedback.tau, -25);
  EXPECT_NEAR(plant.state().q[0], 0, 0.02) << "and the arm stands";
  const double held = plant.state().q[2];
  loop.tick(OperatorRequest::stop);
  loop.run(1000);
  EXPECT_EQ(loop.mode(), Mode::damped_stop);
  EXPECT_NEAR(plant.state().q[2], held, 2e-3) << "a stop brakes and holds it where it is";
}

// Goal: the other finger goes with the driven one. Method: a URDF's mimic joint weighs on the drive: pulled by the same
// force, a coupled finger is half as quick.
TEST_F(GripperTest, AMimicFingerIsCoupledAsAHingeIs) {
  const auto way_of = [&](const std::string& model) {
    config::RobotConfig robot = robot_of(model);
    auto body = MujocoMechanics::make(robot);
    if (!body) throw std::runtime_error(body.error());
    ArmState state{Eigen::VectorXd::Zero(2), Eigen::VectorXd::Zero(2)};
    const Eigen::VectorXd force = Eigen::Vector2d(0, 0.2);  // N on 0.2 kg: 1 m/s2
    for (int step = 0; step < 100; ++step) (*body)->integrate(state, force, std::vector<Friction>(2), milliseconds(1));
    return state.q[1];
  };
  std::string alone = kUrdf;
  alone.erase(alone.find("<mimic"), std::string_view(R"(<mimic joint="finger_left"/>)").size());
  const std::string_view slides = R"("finger_right" type="prismatic")";
  alone.replace(alone.find(slides), slides.size(), R"("finger_right" type="fixed")");
  EXPECT_NEAR(way_of(alone), 0.5 * 1 * 0.01, 2e-4);
  EXPECT_NEAR(way_of(kUrdf), 0.5 * 0.5 * 0.01, 2e-4);
}

TEST_F(GripperTest, TheKindsOfFileAndModelMustBeTheSame) {
  config::RobotConfig robot = robot_of(kArm);
  robot.joints[2].kind = config::JointKind::hinge;
  EXPECT_THAT(MujocoMechanics::make(robot).error(),
              testing::HasSubstr("finger_left slides, and turns in the robot file; write `kind: slide` there"));
  robot.joints[2].kind = robot.joints[0].kind = config::JointKind::slide;
  EXPECT_THAT(MujocoMechanics::make(robot).error(),
              testing::HasSubstr("shoulder turns, and slides in the robot file; leave `kind: slide` out there"));
}

// A slide on the demo arm's first drive and link, along the axis that is given.
config::RobotConfig lone_slide(const config::Vector3& axis) {
  config::RobotConfig robot = test::pendulum(2, 0);
  config::Joint& slide = robot.joints[0];
  slide.kind = config::JointKind::slide;
  slide.drive.gear_ratio = 100;
  slide.inertia = 3;
  robot.model->links[0].axis = axis;
  return robot;
}

constexpr const char* kLoneSlide = R"(schema: takt.robot/1
robot: slide
freshness: { max_age: 120 ms, epsilon: 0.05, window: 1 s, recover_after: 250 ms, stop_after: 600 ms }
degraded: { behaviour: hold }
feedback: { timeout: 20 ms }
buses: [{ name: b, interface: takt_b, when_missing: loopback }]
joints:
  - name: slide
    kind: slide
    bus: b
    drive: { protocol: mit, variant: damiao, id: 1, reply_id: 0x11, direction: -1, gear_ratio: 100 rad/m, position_range: 12.5 rad, velocity_range: 60 rad/s, torque_range: 1 Nm, kp_range: 1 Nm/rad, kd_range: 0.1 Nms/rad, position_after_power_up: absolute }
    limits: { position: [0 m, 0.1 m], position_margin: 0.01 m, velocity: 0.2 m/s, velocity_hard: 0.4 m/s, acceleration: 2 m/s2, torque: 80 N, torque_rate: 4000 N/s, kp: 8000 N/m, kd: 800 Ns/m }
    gains: { kp: 4000 N/m, kd: 300 Ns/m, damping: 300 Ns/m }
    inertia: 4 kg
    home: 0.05 m
model:
  links: [{ joint: slide, parent: base, origin: { xyz: [0 m, 0 m, 0 m] }, axis: [1, 0, 0], mass: 0 kg, com: [0 m, 0 m, 0 m], inertia: [0 kgm2, 0 kgm2, 0 kgm2] }]
  tool: { link: slide, xyz: [0 m, 0 m, 0 m] }
simulation: { encoder_step: 0.001 rad, joint_friction: { coulomb: 0.02 Nm } }
)";

// Goal: without MuJoCo a slide's `inertia` is a mass, and friction and encoder are its motor's, by its gear. Method: a
// drive on a free mass in a loop with the tick: it goes where it is told to, and stays there. In motion
// without it the mass is braked by friction as a force brakes a mass.
TEST(SlideWithoutMujoco, IsAMassThatItsDrivePushes) {
  const auto robot = config::parse(std::string(kLoneSlide) + kPolicy, "r");
  ASSERT_TRUE(robot) << robot.error();
  Plant plant = Plant::on_free_inertias(*robot).value();
  test::WholeLoop loop(*robot, plant);
  ASSERT_TRUE(loop.arm()) << loop.blockers();
  loop.pose[0] = 0.08F;
  loop.run(1500);
  EXPECT_EQ(loop.mode(), Mode::tracking);
  EXPECT_NEAR(plant.state().q[0], 0.08, 5e-4);
  const float read = loop.joint(0).feedback.q;
  EXPECT_NEAR(read, plant.state().q[0], 1.5e-4) << "as the drive's 16 bits have it: 12.5 rad, of which 100 are a metre";
  EXPECT_EQ(friction_of(*robot->simulation, robot->joints[0]).coulomb, 0.02 * 100) << "N";
  config::Simulation sticky;
  sticky.viscous = 0.003;
  EXPECT_NEAR(friction_of(sticky, robot->joints[0]).viscous, 0.003 * 100 * 100, 1e-9) << "Ns/m";
  plant.set_line(0, {.feedback = {.offset = 0.3}});  // rad, of its motor: 3 mm
  loop.run(10);
  EXPECT_NEAR(loop.driver(0).feedback().q - plant.state().q[0], 0.003, 3e-4);
  EXPECT_EQ(loop.mode(), Mode::fault_latched) << "further than the joint can have moved";
  FreeInertias mass({4});
  ArmState state{Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 0.1)};
  for (int i = 0; i < 100; ++i)
    mass.integrate(state, Eigen::VectorXd::Zero(1), {friction_of(*robot->simulation, robot->joints[0])},
                   milliseconds(1));
  EXPECT_NEAR(state.dq[0], 0.1 - 2.0 / 4 * 0.1, 1e-3) << "2 N on 4 kg for 0.1 s";
}

// Goal: a slide's simulated encoder steps as its motor's. Method: 0.05 rad on 100 rad to a metre are 0.5 mm.
TEST(SlideWithoutMujoco, ItsEncoderStepsAreItsMotors) {
  std::string text = std::string(kLoneSlide) + kPolicy;
  for (const auto& [from, to] :
       {std::pair<std::string, std::string>{"encoder_step: 0.001 rad", "encoder_step: 0.05 rad"},
        {"home: 0.05 m", "home: 0.0503 m"}})
    text.replace(text.find(from), from.size(), to);
  const auto robot = config::parse(text, "r");
  ASSERT_TRUE(robot) << robot.error();
  Plant plant = Plant::on_free_inertias(*robot).value();
  test::WholeLoop loop(*robot, plant);
  loop.run(50);
  EXPECT_NEAR(plant.state().q[0], 0.0503, 1e-5);
  EXPECT_NEAR(loop.joint(0).feedback.q, 0.0505, 1e-5);
}

// Goal: a drive that knows its place within a turn knows a slide's where its way is less than a turn of the motor, 63
// mm here, and not where it is more. Method: the same slide with both ways.
TEST(SlideWithoutMujoco, IsPlacedWithinATurnOfItsMotor) {
  const auto arms_with = [](const char* way) {
    std::string text = std::string(kLoneSlide) + kPolicy;
    for (const auto& [from, to] : {std::pair<std::string, std::string>{", position_after_power_up: absolute", ""},
                                   {"[0 m, 0.1 m], position_margin: 0.01 m", way},
                                   {"home: 0.05 m", "home: 0.002 m"}})
      text.replace(text.find(from), from.size(), to);
    const auto robot = config::parse(text, "r");
    EXPECT_TRUE(robot) << robot.error();
    Plant plant = Plant::on_free_inertias(*robot).value();
    test::WholeLoop loop(*robot, plant);
    return loop.arm();
  };
  EXPECT_TRUE(arms_with("[0 m, 0.04 m], position_margin: 0.004 m"));
  EXPECT_FALSE(arms_with("[0 m, 0.06 m], position_margin: 0.004 m"));
}

// Goal: a model's link that slides weighs on its own drive. Method: 2 kg fall along an upright slide as g says, with
// 3 kg of rotor; across gravity they stay.
TEST(SlideWithoutMujoco, FallsByItsWeight) {
  for (const auto& [axis, expected] :
       {std::pair{config::Vector3{0, 0, 1}, -9.81 * 2 / 5}, std::pair{config::Vector3{1, 0, 0}, 0.0}}) {
    const auto dynamics = ArmDynamics::make(lone_slide(axis)).value();
    ArmState state{Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)};
    for (int i = 0; i < 100; ++i)
      dynamics->integrate(state, Eigen::VectorXd::Zero(1), std::vector<Friction>(1), milliseconds(1));
    EXPECT_NEAR(state.dq[0], 0.1 * expected, 1e-6);
  }
}

}  // namespace
}  // namespace takt::simulation
