// SPDX-License-Identifier: Apache-2.0
// Goal: a push, a payload and more friction do to an arm what mechanics says, for as long as they are set.
// Method: the demo arm falling from its home pose for 50 ms, with the trouble and without; what a force does to the
// joints is compared with the work it does at the tool.
#include "simulation/troubled_mechanics.hpp"

#include <gtest/gtest.h>

#include <array>

#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

constexpr std::array kPayloads{2.0};

ArmState at_home(const config::RobotConfig& robot) {
  ArmState state;
  state.q = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.joints.size()));
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    state.q[static_cast<Eigen::Index>(joint)] = robot.joints[joint].home;
  state.dq = Eigen::VectorXd::Zero(state.q.size());
  return state;
}

struct Fall {
  double height = 0, along_x = 0;  // of the tool, m
  ArmState state;
};

Fall fall_with(const BodyTrouble& trouble, int steps = 50) {
  const config::RobotConfig robot = test::demo_arm();
  auto body = TroubledMechanics::make(robot, kPayloads).value();
  body->set(trouble);
  Fall fall{.state = at_home(robot)};
  const Eigen::VectorXd no_torque = Eigen::VectorXd::Zero(fall.state.q.size());
  const std::vector<Friction> friction(robot.joints.size(), Friction{0.5, 0});
  for (int i = 0; i < steps; ++i) body->integrate(fall.state, no_torque, friction, milliseconds(1));
  const config::Vector3 tool = body->tool_position(fall.state.q);
  fall.height = tool[2];
  fall.along_x = tool[0];
  return fall;
}

TEST(TroubledMechanics, APushMovesTheToolItsWay) {
  const double free = fall_with({}).along_x;
  EXPECT_GT(fall_with({.towards = {1, 0, 0}, .force = 50}).along_x, free + 1e-3);
  EXPECT_LT(fall_with({.towards = {-1, 0, 0}, .force = 50}).along_x, free - 1e-3);
}

TEST(TroubledMechanics, APushDoesTheWorkOfItsForce) {
  const Fall free = fall_with({}, 1), pushed = fall_with({.towards = {0, 0, 1}, .force = 10}, 1);
  EXPECT_GT(pushed.state.dq.norm(), 0);
  EXPECT_GT(pushed.height, free.height);
}

TEST(TroubledMechanics, APayloadPullsAlongOnlyWhileItIsSet) {
  const double free = fall_with({}).height;
  EXPECT_NE(fall_with({.payload = 2}).height, free);
  EXPECT_EQ(fall_with({.payload = 0}).height, free);
}

TEST(TroubledMechanics, FrictionSlowsTheFall) {
  EXPECT_LT(fall_with({.friction = 20}).state.dq.norm(), fall_with({}).state.dq.norm());
}

}  // namespace
}  // namespace takt::simulation
