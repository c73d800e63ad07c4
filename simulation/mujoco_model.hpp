// SPDX-License-Identifier: Apache-2.0
// A model file in MuJoCo's memory, adapted to version 2.2.2 where needed. It is read in a child of ours with bounds on
// memory and time (bounded_child.hpp), where it is stepped once too. Errors: one sentence, MuJoCo's own with the file's
// line. MuJoCo's errors later on are std::runtime_error; its warnings are in mjData alone.
#pragma once

#include <mujoco/mujoco.h>

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/model_text.hpp"

namespace takt::simulation {

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

// MJCF or URDF. `mesh_path`: where meshes are looked for that are not where the model names them; empty: nowhere else.
// A mesh that is nowhere and neither collides nor weighs is done without. A URDF's <mimic> holds as an equality.
std::expected<LoadedModel, std::string> load_model(const config::ModelText& text, const std::string& mesh_path = {});

// The model as one text with the whole paths of its meshes, as MuJoCo 2.2.2 reads it from anywhere.
std::string with_whole_paths(const config::ModelText& text, const std::string& mesh_path);

// Whether an equality of the model makes this joint follow another one, and nothing else moves it: of the two the one
// without an actuator, else the first.
bool is_led(const mjModel& model, int joint);

// The body with this root is free, and there is nothing that it could stand on.
bool falls_for_ever(const mjModel& model, int root);

}  // namespace takt::simulation
