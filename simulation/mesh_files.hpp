// SPDX-License-Identifier: Apache-2.0
// Where the meshes and textures of an MJCF text are, and what stands in for those that are not there.
#pragma once

#include <string>
#include <vector>

namespace takt::simulation {

struct MeshFiles {
  std::string text;
  std::vector<std::string> missing;  // meshes' files, as the model names them
};

// `text`: with a whole path as `meshdir` and `texturedir`, as mend_mjcf leaves it. A mesh that is not where the model
// names it is looked for under `mesh_path` (empty: nowhere else), by the same name and by the file's name alone, and
// named there by its whole path. One that is nowhere becomes `stand_in`, and a texture grey; `stand_in` empty: both
// stay as they are.
MeshFiles find_mesh_files(const std::string& text, const std::string& mesh_path, const std::string& stand_in);

// A tetrahedron of this size (m), as attributes of a <mesh>.
std::string stand_in_mesh(double size);

}  // namespace takt::simulation
