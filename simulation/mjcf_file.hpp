// SPDX-License-Identifier: Apache-2.0
// A model file of newer MuJoCo versions as version 2.2.2 reads it: what it does not know and the simulator does not use
// is taken out (mjcf_newer.hpp, mjcf_frames.hpp), paths become absolute. Line numbers stay. A URDF is given the
// <mujoco> element that it lacks, and its meshes are found as ROS finds them: package://NAME/REST in the folder NAME
// around or beside the file, or under a folder that is given.
#pragma once

#include <string>
#include <vector>

namespace takt::simulation {

// What a URDF's link without a mass weighs: kg, kgm2.
inline constexpr double kLeastLinkMass = 1e-6, kLeastLinkInertia = 1e-9;

struct MendedMjcf {
  std::string text;
  std::vector<std::string> mended;  // one sentence for each kind of change, with the first line it was made in
};

// `folder`: of the file, absolute; what the model names relatively is found there. `mesh_path`: where a URDF's meshes
// are looked for next; empty: nowhere else.
MendedMjcf mend_mjcf(std::string text, const std::string& folder, const std::string& mesh_path = {});

}  // namespace takt::simulation
