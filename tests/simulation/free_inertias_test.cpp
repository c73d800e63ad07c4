// SPDX-License-Identifier: Apache-2.0
// Goal: a drive on a flywheel moves as Newton says. Method: closed solutions of J ddq + b dq + c sign(dq) = tau.
#include "simulation/free_inertias.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace takt::simulation {
namespace {

struct Wheel {
  explicit Wheel(double inertia) : dynamics({inertia}) {}
  void run(int ms, double torque, Friction friction = {}) {
    for (int i = 0; i < ms; ++i)
      dynamics.integrate(state, Eigen::VectorXd::Constant(1, torque), {friction}, milliseconds(1));
  }
  FreeInertias dynamics;
  ArmState state{Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)};
};

TEST(FreeInertias, ConstantTorqueGivesSpeedAndAngle) {
  Wheel wheel(0.05);
  wheel.run(500, 0.2);
  const double acceleration = 0.2 / 0.05;
  EXPECT_NEAR(wheel.state.dq[0], acceleration * 0.5, 1e-9);
  // Semi-implicit: the angle is ahead by half a step's worth of speed.
  EXPECT_NEAR(wheel.state.q[0], acceleration * 0.5 * 0.5 / 2, 0.5e-3 * wheel.state.dq[0] + 1e-9);
}

TEST(FreeInertias, ViscousFrictionDecaysExponentially) {
  Wheel wheel(0.05);
  wheel.state.dq[0] = 10;
  wheel.run(1000, 0, {.viscous = 0.1, .coulomb = 0});
  // Time constant J / b = 0.5 s; implicit Euler is off by t dt / (2 T^2) of the value, 0.2 %.
  EXPECT_NEAR(wheel.state.dq[0], 10 * std::exp(-2.0), 10 * std::exp(-2.0) * 0.003);
}

TEST(FreeInertias, CoulombFrictionStopsItWhenTheEnergyIsSpentAndHolds) {
  Wheel wheel(0.05);
  wheel.state.dq[0] = 2;
  const Friction friction{.viscous = 0, .coulomb = 0.1};
  wheel.run(900, 0, friction);
  EXPECT_NEAR(wheel.state.dq[0], 0.2, 0.02) << "at rest after J dq / c = 1 s";
  wheel.run(600, 0, friction);
  EXPECT_NEAR(wheel.state.dq[0], 0, kRestSpeed);
  EXPECT_NEAR(wheel.state.q[0], 0.05 * 2 * 2 / 2 / 0.1, 0.01);
  const double at = wheel.state.q[0];
  wheel.run(1000, 0.09, friction);
  EXPECT_NEAR(wheel.state.q[0], at, 2 * kRestSpeed) << "less than friction moves nothing";
}

TEST(FreeInertias, WheelsDoNotFeelEachOther) {
  FreeInertias dynamics({0.1, 0.2});
  ArmState state{Eigen::VectorXd::Zero(2), Eigen::VectorXd::Zero(2)};
  Eigen::VectorXd torque(2);
  torque << 1, 0;
  dynamics.integrate(state, torque, {{}, {}}, milliseconds(1));
  EXPECT_NEAR(state.dq[0], 0.01, 1e-12);
  EXPECT_EQ(state.dq[1], 0);
}

}  // namespace
}  // namespace takt::simulation
