// SPDX-License-Identifier: Apache-2.0
// A robot in MuJoCo's physics: the user's own model (MJCF) with its contacts, friction, terrain and free base, driven
// by the torques of the robot file's simulated drives. The model's joints are found by name; its actuators are not
// used.
//
// Each step is as many of MuJoCo's as keep its step at or below the model's `timestep`. Joint friction and limits are
// the model's; what `simulation.joint_friction` and a drive's brake add acts on top. A robot with a free joint at its
// root hangs where it began while hoist(true) stands; base() of one without stands still. The same model, torques and
// build give the same bits.
//
// Errors of make(): one sentence; for what MuJoCo refuses, its own with the file's line. A simulation that diverges
// throws std::runtime_error. Thread rule: one thread at a time. Source: MuJoCo 2.2.2, mujoco.h and its documentation.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "simulation/mechanics.hpp"

namespace takt::simulation {

class MujocoMechanics : public Mechanics {
 public:
  static std::expected<std::unique_ptr<MujocoMechanics>, std::string> make(const config::RobotConfig& robot);
};

}  // namespace takt::simulation
