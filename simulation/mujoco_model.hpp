// A model file in MuJoCo's memory, mended for version 2.2.2 where needed. Errors: one sentence, MuJoCo's own with the
// file's line.
#pragma once

#include <mujoco/mujoco.h>

#include <expected>
#include <memory>
#include <string>
#include <vector>

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

// MJCF or URDF; `text` is the file's, `path` where it lies.
std::expected<std::string, std::string> read_model_file(const std::string& path);
std::expected<LoadedModel, std::string> load_model(std::string text, const std::string& path);

}  // namespace takt::plant
