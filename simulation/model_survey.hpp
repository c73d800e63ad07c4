// SPDX-License-Identifier: Apache-2.0
// Reads a published robot model (MJCF, URDF) for what a robot file needs of it, by MuJoCo itself.
//
// Torque: `actuatorfrcrange` of the joint, else what its actuator may give (forcerange, or a motor's ctrlrange by its
// gear), else URDF's effort. Velocity: URDF's. Inertia: 1 / (M^-1)_jj at the keyframe. IMU: the site of the first gyro,
// else one whose name has `imu`. Keyframe: one called home or stand, else the first. The robot is the tree of bodies
// with the most hinges and slides; joints of other objects are not its own, and one that an equality or a URDF's
// <mimic> makes follow another is none that a drive moves: both are remarks. A joint whose range ends below its
// beginning is refused. `mesh_path`: as load_model's.
// Errors: one sentence; a build without MuJoCo says so.
#pragma once

#include <expected>
#include <string>

#include "config/model_facts.hpp"

namespace takt::simulation {

std::expected<config::ModelFacts, std::string> survey_model(const std::string& path, const std::string& mesh_path = {});

// The same model's text with the whole paths of its meshes, to be kept where those of the original are not found.
std::expected<std::string, std::string> model_with_whole_paths(const std::string& path, const std::string& mesh_path);

}  // namespace takt::simulation
