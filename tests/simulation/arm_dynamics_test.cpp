// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated arm obeys physics.
// Method: a pendulum against its closed form, the demo arm's gravity against the gradient of its potential energy,
// energy that friction may only take away, stops that hold.
#include "simulation/arm_dynamics.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

constexpr double kG = 9.81;
const std::vector<Friction> kNoFriction(1);

ArmState one_joint(double q, double dq = 0) {
  return {Eigen::VectorXd::Constant(1, q), Eigen::VectorXd::Constant(1, dq)};
}
Eigen::VectorXd none(Eigen::Index joints = 1) {
  return Eigen::VectorXd::Zero(joints);
}

TEST(ArmDynamics, APendulumSwingsWithItsPeriod) {
  const auto arm = ArmDynamics::make(test::pendulum(2, 0.5));
  ASSERT_TRUE(arm) << arm.error();
  ArmState state = one_joint(0.05);
  // Quarter periods by counting zero crossings over ten periods.
  int crossings = 0;
  double last_crossing = 0;
  double before = state.q[0];
  for (int step = 1; crossings < 20 && step < 100'000; ++step) {
    (*arm)->integrate(state, none(), kNoFriction, milliseconds(1));
    if (before * state.q[0] < 0) {
      ++crossings;
      last_crossing = step * 1e-3;
    }
    before = state.q[0];
  }
  // Crossings at T/4, 3T/4, ...: the 20th at T/4 + 19 T/2. Amplitude 0.05 rad lengthens T by theta^2/16 = 0.016 %.
  const double period = last_crossing / (0.25 + 19 * 0.5);
  const double expected = 2 * std::numbers::pi * std::sqrt(0.5 / kG) * (1 + 0.05 * 0.05 / 16);
  EXPECT_NEAR(period, expected, 1e-3 * expected);
}

TEST(ArmDynamics, ASwingKeepsItsEnergy) {
  const auto arm = ArmDynamics::make(test::pendulum(2, 0.5));
  ASSERT_TRUE(arm);
  ArmState state = one_joint(1.5);
  const auto energy = [&] { return (*arm)->kinetic_energy(state) - 2 * kG * 0.5 * std::cos(state.q[0]); };
  const double start = energy();
  const double scale = 2 * kG * 0.5;
  for (int step = 0; step < 10'000; ++step) {
    (*arm)->integrate(state, none(), kNoFriction, milliseconds(1));
    ASSERT_NEAR(energy(), start, 0.01 * scale) << step;
  }
}

TEST(ArmDynamics, ViscousFrictionDecaysAsItsEquationSays) {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  robot.model->gravity = {0, 0, 0};
  const auto arm = ArmDynamics::make(robot);
  ArmState state = one_joint(0, 3);
  const std::vector<Friction> friction{{0.4, 0}};
  for (int step = 0; step < 1000; ++step) (*arm)->integrate(state, none(), friction, milliseconds(1));
  // I dq' = -b dq, I = m l^2 = 0.5: dq(1 s) = 3 exp(-0.4 / 0.5).
  EXPECT_NEAR(state.dq[0], 3 * std::exp(-0.8), 0.002);
}

TEST(ArmDynamics, CoulombFrictionStopsAndHolds) {
  config::RobotConfig robot = test::pendulum(1, 1);
  robot.model->gravity = {0, 0, 0};
  const auto arm = ArmDynamics::make(robot);
  ArmState state = one_joint(0, 1);
  const std::vector<Friction> friction{{0, 0.5}};
  for (int step = 0; step < 1000; ++step) (*arm)->integrate(state, none(), friction, milliseconds(1));
  // dq' = -0.5: half the speed after one second.
  EXPECT_NEAR(state.dq[0], 0.5, 0.002);
  for (int step = 0; step < 1500; ++step) (*arm)->integrate(state, none(), friction, milliseconds(1));
  EXPECT_NEAR(state.dq[0], 0, 1e-6);
  EXPECT_NEAR(state.q[0], 1.0, 0.005) << "v^2 / 2a";
  const double rest = state.q[0];
  for (int step = 0; step < 1000; ++step)
    (*arm)->integrate(state, Eigen::VectorXd::Constant(1, 0.4), friction, milliseconds(1));
  EXPECT_NEAR(state.q[0], rest, 2 * kRestSpeed) << "less than breakaway torque moves nothing";
}

TEST(ArmDynamics, GravityTorqueIsTheGradientOfPotentialEnergy) {
  const config::RobotConfig robot = test::demo_arm();
  auto arm = ArmDynamics::make(robot);
  ASSERT_TRUE(arm) << arm.error();
  // Potential energy through forward kinematics alone: each link as a tool of the arm that ends with it.
  std::vector<std::unique_ptr<ArmDynamics>> cut_arms;
  for (std::size_t count = 1; count <= robot.joints.size(); ++count) {
    config::RobotConfig cut = robot;
    cut.joints.resize(count);
    cut.model->links.resize(count);
    cut.model->tool_link = static_cast<int>(count) - 1;
    cut.model->tool_xyz = robot.model->links[count - 1].com;
    cut_arms.push_back(std::move(*ArmDynamics::make(cut)));
  }
  const auto potential = [&](const Eigen::VectorXd& q) {
    double sum = 0;
    for (std::size_t i = 0; i < cut_arms.size(); ++i)
      sum += robot.model->links[i].mass * kG * cut_arms[i]->tool_position(q.head(static_cast<Eigen::Index>(i) + 1))[2];
    return sum;
  };
  Eigen::VectorXd q(6);
  q << 0.3, 0.7, -1.1, 0.4, 0.8, -0.5;
  const Eigen::VectorXd torque = (*arm)->gravity_torque(q);
  for (Eigen::Index joint = 0; joint < 6; ++joint) {
    constexpr double kStep = 1e-5;
    Eigen::VectorXd up = q;
    Eigen::VectorXd down = q;
    up[joint] += kStep;
    down[joint] -= kStep;
    EXPECT_NEAR(torque[joint], (potential(up) - potential(down)) / (2 * kStep), 1e-6) << joint;
  }
  EXPECT_GT(torque.cwiseAbs().maxCoeff(), 1) << "a pose in which gravity matters";
}

TEST(ArmDynamics, InertiaIsAtLeastTheConfiguredLowerBound) {
  const config::RobotConfig robot = test::demo_arm();
  auto arm = ArmDynamics::make(robot);
  Eigen::VectorXd q(6);
  for (int pose = 0; pose < 50; ++pose) {
    for (Eigen::Index i = 0; i < 6; ++i) q[i] = 2.5 * std::sin(7.0 * pose + 3.0 * static_cast<double>(i));
    const Eigen::MatrixXd inverse = (*arm)->inertia(q).inverse();
    for (Eigen::Index i = 0; i < 6; ++i)
      EXPECT_GE(1 / inverse(i, i), robot.joints[static_cast<std::size_t>(i)].inertia);
  }
}

TEST(ArmDynamics, FrictionNeverAddsEnergyToTheWholeArm) {
  config::RobotConfig robot = test::demo_arm();
  robot.model->gravity = {0, 0, 0};
  auto arm = ArmDynamics::make(robot);
  ArmState state{Eigen::VectorXd::Zero(6), Eigen::VectorXd::Zero(6)};
  state.dq << 1, -2, 2, 3, -3, 4;
  const std::vector<Friction> friction(6, {0.15, 0.1});
  double energy = (*arm)->kinetic_energy(state);
  for (int step = 0; step < 3000; ++step) {
    (*arm)->integrate(state, none(6), friction, milliseconds(1));
    const double now = (*arm)->kinetic_energy(state);
    ASSERT_LE(now, energy * 1.0005 + 1e-9) << step;
    energy = now;
  }
  EXPECT_LT(energy, 1e-3);
}

TEST(ArmDynamics, StopsHoldAndDoNotBounce) {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  robot.joints[0].limits.q_min = -1;
  robot.joints[0].limits.q_max = 1;
  robot.joints[0].limits.position_margin = 0.1;
  auto arm = ArmDynamics::make(robot);
  EXPECT_DOUBLE_EQ((*arm)->upper_stop(0), 1.2);
  EXPECT_DOUBLE_EQ((*arm)->lower_stop(0), -1.2);
  ArmState state = one_joint(1.1, 5);
  for (int step = 0; step < 100; ++step) {
    (*arm)->integrate(state, Eigen::VectorXd::Constant(1, 30), kNoFriction, milliseconds(1));
    ASSERT_LE(state.q[0], 1.2);
  }
  EXPECT_DOUBLE_EQ(state.q[0], 1.2);
  EXPECT_DOUBLE_EQ(state.dq[0], 0);
  for (int step = 0; step < 10; ++step)
    (*arm)->integrate(state, Eigen::VectorXd::Constant(1, -30), kNoFriction, milliseconds(1));
  EXPECT_LT(state.q[0], 1.2) << "it lets go inwards";
}

TEST(ArmDynamics, ForwardKinematicsOfTheDemoArm) {
  auto arm = ArmDynamics::make(test::demo_arm());
  // At zero: base 0.08 + 0.06 up, 0.28 up to the elbow, then 0.24 + 0.06 + 0.05 + 0.08 forward.
  const config::Vector3 straight = (*arm)->tool_position(none(6));
  EXPECT_NEAR(straight[0], 0.43, 1e-9);
  EXPECT_NEAR(straight[1], 0, 1e-9);
  EXPECT_NEAR(straight[2], 0.42, 1e-9);
  // Base turned by a quarter: the same forward reach, along y.
  Eigen::VectorXd q = none(6);
  q[0] = std::numbers::pi / 2;
  EXPECT_NEAR((*arm)->tool_position(q)[1], 0.43, 1e-9);
}

TEST(ArmDynamics, RefusesWhatIsNoSerialArm) {
  config::RobotConfig robot = test::demo_arm();
  robot.model->links[3].parent = 1;
  EXPECT_FALSE(ArmDynamics::make(robot));
  robot = test::demo_arm();
  robot.model->tool_link = 2;
  EXPECT_FALSE(ArmDynamics::make(robot));
  robot.model.reset();
  EXPECT_FALSE(ArmDynamics::make(robot));
}

}  // namespace
}  // namespace takt::simulation
