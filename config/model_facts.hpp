// SPDX-License-Identifier: Apache-2.0
// What a published robot model (MJCF, URDF) says that a robot file needs. SI units; absent: the model does not say. Of
// a slide: m, m/s, N, kg.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::config {

struct ModelJoint {
  std::string name;
  JointKind kind = JointKind::hinge;
  std::optional<std::pair<double, double>> position;  // rad, lowest and highest
  std::optional<double> velocity, torque;             // rad/s, Nm
  double inertia = 0;                                 // kg m^2, as the model stands, every other joint free
  double home = 0;                                    // rad, where the model begins, within its limits
};

struct ModelFacts {
  std::vector<ModelJoint> joints;   // hinges and slides of the robot, in its bodies' order, but for those that follow
  std::vector<std::string> motors;  // of them those with an actuator, in the actuators' order, each once
  std::string keyframe;             // where the robot begins; empty: none
  std::string imu_site;             // empty: none
  std::vector<std::string> remarks{};  // what a robot file does not take over as it stands, one sentence each
};

}  // namespace takt::config
