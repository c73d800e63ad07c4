// SPDX-License-Identifier: Apache-2.0
// Robots for the plant's tests: the demo arm, and a single pendulum small enough to be solved by hand.
#pragma once

#include <gtest/gtest.h>

#include "config/load.hpp"

namespace takt::test {

inline config::RobotConfig demo_arm() {
  auto robot = config::load("config/arm6.yaml");
  if (!robot) throw std::runtime_error(robot.error());
  return *robot;
}

// A point mass m at distance l below a hinge about y; no rotor inertia, far-away stops. Angle 0: hanging.
inline config::RobotConfig pendulum(double mass, double length, double step_ms = 1) {
  config::RobotConfig robot = demo_arm();
  robot.joints.resize(1);
  robot.joints[0].inertia = 0;
  robot.joints[0].limits.q_min = -100;
  robot.joints[0].limits.q_max = 100;
  robot.model->links.resize(1);
  config::Link& link = robot.model->links[0];
  link = {};
  link.joint = robot.joints[0].name;
  link.axis = {0, 1, 0};
  link.mass = mass;
  link.com = {0, 0, -length};
  robot.model->tool_link = 0;
  robot.model->tool_xyz = {0, 0, -length};
  robot.simulation->viscous = robot.simulation->coulomb = 0;
  robot.simulation->step = Duration{static_cast<std::int64_t>(step_ms * 1e6)};
  return robot;
}

// The joint's drive moves a slide of 40 mm, 100 rad of it to a metre.
inline void slide(config::Joint& joint) {
  joint.kind = config::JointKind::slide;
  joint.drive.gear_ratio = 100;
  joint.drive.kp_range = 1;
  joint.drive.kd_range = 0.1;
  joint.drive.torque_range = 2;
  joint.drive.position_after_power_up = config::PositionAfterPowerUp::absolute;
  joint.limits.q_min = 0;
  joint.limits.q_max = 0.04;
  joint.limits.torque = 60;
  joint.kp = 2000;
  joint.kd = 90;
}

}  // namespace takt::test
