// SPDX-License-Identifier: Apache-2.0
// Reads a published robot model (MJCF, URDF) for what a robot file needs of it, by MuJoCo itself.
//
// Torque: `actuatorfrcrange` of the joint, else what its actuator may give (forcerange, or a motor's ctrlrange by its
// gear), else URDF's effort. Velocity: URDF's. Inertia: 1 / (M^-1)_jj at the keyframe. IMU: the site of the first gyro,
// else one whose name has `imu`. Keyframe: one called home or stand, else the first.
// Errors: one sentence; a build without MuJoCo says so.
#pragma once

#include <expected>
#include <string>

#include "config/model_facts.hpp"

namespace takt::plant {

std::expected<config::ModelFacts, std::string> survey_model(const std::string& path);

}  // namespace takt::plant
