// SPDX-License-Identifier: Apache-2.0
// Goal: the cart and its pole move as physics says. Method: energy without friction and torque; small motions against
// the linearised equations, written down here by hand for a point in joint coordinates; a push on the cart against the
// momentum of the whole; the stops; and what a robot file must say to get one.
#include "simulation/cart_pole_dynamics.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "config/load.hpp"

namespace takt::simulation {
namespace {

constexpr double kG = 9.81;

config::RobotConfig demo() {
  auto robot = config::load("config/cart_pole.yaml");
  if (!robot) throw std::runtime_error(robot.error());
  return *robot;
}

// Stops far away, nothing rubs.
config::RobotConfig free_demo() {
  config::RobotConfig robot = demo();
  for (config::Joint& joint : robot.joints) {
    joint.limits.q_min = -1000;
    joint.limits.q_max = 1000;
  }
  robot.simulation->cart_pole->pivot_viscous = 0;
  return robot;
}

ArmState at(double cart, double pole, double cart_speed = 0, double pole_speed = 0) {
  return {Eigen::Vector2d(cart, pole), Eigen::Vector2d(cart_speed, pole_speed)};
}

const std::vector<Friction> kNone(2);

TEST(CartPoleDynamics, KeepsItsEnergyWithoutFrictionAndTorque) {
  const auto machine = CartPoleDynamics::make(free_demo());
  ASSERT_TRUE(machine) << machine.error();
  ArmState state = at(0, 0.4, 3, 0);
  const double before = (*machine)->energy(state);
  double fastest = 0;
  for (int ms = 0; ms < 5000; ++ms) {
    (*machine)->integrate(state, Eigen::Vector2d::Zero(), kNone, milliseconds(1));
    fastest = std::max(fastest, std::abs(state.dq[1]));
  }
  EXPECT_GT(fastest, 5) << "the pole went round: the test saw large motions";
  const double swing = 2 * 0.2 * kG * 0.3;  // of the pole, from top to bottom, J
  EXPECT_NEAR((*machine)->energy(state), before, 0.01 * swing);
}

// Near upright, M0 [ddx; dda] = [tau; m g l a], with M0 the inertia of the upright pole.
TEST(CartPoleDynamics, SmallMotionsAreTheLinearised) {
  const config::RobotConfig robot = free_demo();
  const config::CartPole& machine = *robot.simulation->cart_pole;
  const double r = machine.pulley_radius, m = machine.pole_mass, l = machine.pole_com;
  Eigen::Matrix2d mass;
  mass << (machine.cart_mass + m) * r * r + robot.joints[0].inertia, m * l * r, m * l * r,
      machine.pole_inertia + m * l * l;
  const Eigen::Vector2d tau(0.001, 0);
  const double lean = 1e-3;
  const Eigen::Vector2d expected = mass.inverse() * Eigen::Vector2d(tau[0], m * kG * l * lean);
  ArmState state = at(0, lean);
  (*CartPoleDynamics::make(robot))->integrate(state, tau, kNone, milliseconds(1));
  EXPECT_NEAR(state.dq[0], expected[0] * 1e-3, 1e-3 * std::abs(expected[0] * 1e-3));
  EXPECT_NEAR(state.dq[1], expected[1] * 1e-3, 1e-3 * std::abs(expected[1] * 1e-3));
}

TEST(CartPoleDynamics, ATorqueOnTheCartBecomesItsMomentum) {
  const config::RobotConfig robot = free_demo();
  const auto machine = *CartPoleDynamics::make(robot);
  ArmState state = at(0, 0.3, 0, 2);
  const auto momentum = [&] { return (machine->inertia(state.q[1]) * Eigen::Vector2d(state.dq))[0]; };
  const double before = momentum();
  for (int ms = 0; ms < 500; ++ms) machine->integrate(state, Eigen::Vector2d(0.4, 0), kNone, milliseconds(1));
  EXPECT_NEAR(momentum() - before, 0.4 * 0.5, 0.002);
}

TEST(CartPoleDynamics, FallsTowardsWhereItLeansAndPushesTheCartAway) {
  const auto machine = *CartPoleDynamics::make(free_demo());
  ArmState state = at(0, 0.05);
  for (int ms = 0; ms < 300; ++ms) machine->integrate(state, Eigen::Vector2d::Zero(), kNone, milliseconds(1));
  EXPECT_GT(state.q[1], 0.1);
  EXPECT_LT(state.q[0], 0);
}

TEST(CartPoleDynamics, ItsPointsAreTheCartAndThePolesTip) {
  const auto machine = *CartPoleDynamics::make(demo());
  const Eigen::VectorXd q = Eigen::Vector2d(4, std::asin(0.5));
  EXPECT_NEAR(machine->controlled_point(q)[0], 0.2, 1e-12);
  EXPECT_NEAR(machine->tool_position(q)[0], 0.2 + 0.3, 1e-12);
  EXPECT_NEAR(machine->tool_position(q)[2], 0.6 * std::cos(std::asin(0.5)), 1e-12);
}

TEST(CartPoleDynamics, AFallenPoleLiesOnItsStop) {
  const auto machine = *CartPoleDynamics::make(demo());
  ArmState state = at(0, 0.2);
  for (int ms = 0; ms < 3000; ++ms)
    machine->integrate(state, Eigen::Vector2d::Zero(), {{0.01, 0.02}, {0, 0}}, milliseconds(1));
  EXPECT_NEAR(state.q[1], 0.7, 1e-12) << "limit 0.5 and twice its margin of 0.1";
  EXPECT_NEAR(state.dq[1], 0, 1e-9);
}

TEST(CartPoleDynamics, RefusesARobotWithoutOne) {
  config::RobotConfig robot = demo();
  robot.simulation->cart_pole.reset();
  EXPECT_FALSE(CartPoleDynamics::make(robot));
  robot = demo();
  robot.joints.pop_back();
  EXPECT_FALSE(CartPoleDynamics::make(robot));
}

}  // namespace
}  // namespace takt::simulation
