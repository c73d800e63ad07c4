// SPDX-License-Identifier: Apache-2.0
// A model file in MuJoCo's memory, mended for version 2.2.2 where needed. Errors: one sentence, MuJoCo's own with the
// file's line.
#pragma once

#include <mujoco/mujoco.h>

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/model_text.hpp"

namespace takt::plant {

struct DeleteModel {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};

struct LoadedModel {
  std::unique_ptr<mjModel, DeleteModel> model;
  std::vector<std::string> mended;
};

// MJCF or URDF.
std::expected<LoadedModel, std::string> load_model(const config::ModelText& text);

}  // namespace takt::plant
