// SPDX-License-Identifier: Apache-2.0
// What a published robot model (MJCF, URDF) says that a robot file needs. SI units; absent: the model does not say.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace takt::config {

struct ModelJoint {
  std::string name;
  std::optional<std::pair<double, double>> position;  // rad, lowest and highest
  std::optional<double> velocity, torque;             // rad/s, Nm
  double inertia = 0;                                 // kg m^2, as the model stands, every other joint free
};

struct ModelFacts {
  std::vector<ModelJoint> joints;   // hinges, in the order of the model's bodies
  std::vector<std::string> motors;  // hinges with an actuator, in the actuators' order, each once
  std::string keyframe;             // where the robot begins; empty: none
  std::string imu_site;             // empty: none
};

}  // namespace takt::config
