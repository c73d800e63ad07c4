// SPDX-License-Identifier: Apache-2.0
#include "simulation/mujoco_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "config/read_all.hpp"
#include "config/robot_text.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "simulation/bounded_child.hpp"
#include "simulation/mesh_files.hpp"
#include "simulation/mjcf_file.hpp"
#include "simulation/urdf_mimics.hpp"

namespace takt::simulation {
namespace {

namespace fs = std::filesystem;

using Model = std::unique_ptr<mjModel, DeleteModel>;

// By itself MuJoCo writes a file into the working directory; after an error it asks for the Enter key and ends the
// program, after a warning it goes on from the initial state.
void take_errors_and_warnings() {
  mju_user_error = [](const char* sentence) { throw std::runtime_error(fmt::format("MuJoCo: {}", sentence)); };
  mju_user_warning = [](const char*) {};
}

// MuJoCo reads and writes files. This one has no name, and is there for a policy too, which may write no folder.
class MemoryFile {
 public:
  explicit MemoryFile(const std::string& bytes = "")
      : file_(memfd_create("takt-model", MFD_CLOEXEC)), path_(fmt::format("/proc/self/fd/{}", file_)) {
    if (!bytes.empty()) std::ofstream(path_, std::ios::binary) << bytes;
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() {
    if (file_ >= 0) close(file_);
  }
  [[nodiscard]] bool is_open() const { return file_ >= 0; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  int file_;
  std::string path_;
};

MendedMjcf mend(const config::ModelText& text, const std::string& mesh_path) {
  return mend_mjcf(text.text, fs::absolute(text.files.front()).parent_path().lexically_normal().string(), mesh_path);
}

std::expected<Model, std::string> compile(const std::string& path) {
  char error[1000] = "";
  Model model(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  if (model) return model;
  std::string sentence = error;
  while (sentence.ends_with('\n')) sentence.pop_back();
  std::ranges::replace(sentence, '\n', ' ');
  const bool is_unknown = sentence.find("unrecognized") != std::string::npos;
  const bool lacks_file =
      sentence.find("rror opening file") != std::string::npos || sentence.find("ould not open") != std::string::npos;
  return std::unexpected(
      fmt::format("MuJoCo {} refuses it: {}{}", mj_versionString(), sentence,
                  is_unknown   ? "; take it out, or save the model as one file by the MuJoCo that knows it "
                                 "(mj_saveLastXML), or play it there as a world of your own (docs/world-protocol.md)"
                  : lacks_file ? "; name the folder of its meshes with takt config new or import and --mesh-path"
                               : ""));
}

// What MuJoCo made of a URDF, with its mimic joints held.
std::expected<Model, std::string> compile_coupled(const std::string& path, const std::string& equalities) {
  auto model = compile(path);
  if (!model || equalities.empty()) return model;
  const MemoryFile written;
  char error[1000] = "";
  if (mj_saveLastXML(written.path().c_str(), model->get(), error, sizeof error) == 0) return std::unexpected(error);
  std::ifstream stream(written.path());
  std::string text = config::read_all(stream).value_or("");
  text.insert(std::min(text.rfind("</mujoco>"), text.size()), equalities);
  return compile(MemoryFile(text).path());
}

bool collides(const mjModel& model, int geom) {
  for (int pair = 0; pair < model.npair; ++pair)
    if (model.pair_geom1[pair] == geom || model.pair_geom2[pair] == geom) return true;
  return model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0;
}

// Whether a mesh's size makes no difference to motion: `other` has meshes of another size in place of the missing ones.
bool moves_alike(const mjModel& model, const mjModel& other) {
  const auto same = [](const mjtNum* one, const mjtNum* two, int count) { return std::equal(one, one + count, two); };
  if (!same(model.body_mass, other.body_mass, model.nbody) ||
      !same(model.body_ipos, other.body_ipos, 3 * model.nbody) ||
      !same(model.body_inertia, other.body_inertia, 3 * model.nbody))
    return false;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const std::ptrdiff_t at = std::ptrdiff_t{3} * geom;
    if (collides(model, geom) &&
        !(same(model.geom_size + at, other.geom_size + at, 3) && same(model.geom_pos + at, other.geom_pos + at, 3)))
      return false;
  }
  return true;
}

std::string some_of(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 3;
  if (names.size() <= kShown) return fmt::format("{}", fmt::join(names, ", "));
  return fmt::format("{} and {} more", fmt::join(names.begin(), names.begin() + kShown, ", "), names.size() - kShown);
}

// What the model's file names, found; twice where something stands in for meshes that are missing.
class Sources {
 public:
  Sources(const std::string& mended, const std::string& mesh_path)
      : found_(find_mesh_files(mended, mesh_path, stand_in_mesh(0.01))),
        first_(found_.text),
        second_(found_.missing.empty() ? "" : find_mesh_files(mended, mesh_path, stand_in_mesh(0.02)).text),
        equalities_(mimics_as_equalities(mended)) {}

  [[nodiscard]] std::expected<Model, std::string> compile() const {
    auto model = compile_coupled(first_.path(), equalities_);
    if (!model || found_.missing.empty()) return model;
    const auto other = compile_coupled(second_.path(), equalities_);
    if (!other) return std::unexpected(other.error());
    if (moves_alike(**model, **other)) return model;
    return std::unexpected(
        fmt::format("its meshes {} are not there, and robots collide or weigh by them; name their "
                    "folder with takt config new or import and --mesh-path",
                    some_of(found_.missing)));
  }
  [[nodiscard]] std::string note() const {
    return found_.missing.empty() ? ""
                                  : fmt::format("meshes {} are not there; they are only seen, and nothing is drawn",
                                                some_of(found_.missing));
  }

 private:
  MeshFiles found_;
  MemoryFile first_, second_;
  std::string equalities_;
};

bool has_actuator(const mjModel& model, int joint) {
  for (int i = 0; i < model.nu; ++i)
    if ((model.actuator_trntype[i] == mjTRN_JOINT || model.actuator_trntype[i] == mjTRN_JOINTINPARENT) &&
        model.actuator_trnid[std::ptrdiff_t{2} * i] == joint)
      return true;
  return false;
}

std::expected<void, std::string> compile_to(const Sources& sources, const std::string& result) {
  const auto model = sources.compile();
  if (!model) return std::unexpected(model.error());
  const std::unique_ptr<mjData, DeleteData> data(mj_makeData(model->get()));
  mj_forward(model->get(), data.get());
  mj_saveModel(model->get(), result.c_str(), nullptr, 0);
  return {};
}

}  // namespace

std::string with_whole_paths(const config::ModelText& text, const std::string& mesh_path) {
  return find_mesh_files(mend(text, mesh_path).text, mesh_path, "").text;
}

bool is_led(const mjModel& model, int joint) {
  for (int i = 0; i < model.neq; ++i) {
    if (model.eq_type[i] != mjEQ_JOINT || model.eq_active[i] == 0 || model.eq_obj2id[i] < 0) continue;
    const int first = model.eq_obj1id[i], second = model.eq_obj2id[i];
    const bool leads_second = has_actuator(model, first) && !has_actuator(model, second);
    if (joint == (leads_second ? second : first)) return true;
  }
  return false;
}

bool falls_for_ever(const mjModel& model, int root) {
  const int joint = model.body_jntadr[root];
  if (model.body_jntnum[root] == 0 || model.jnt_type[joint] != mjJNT_FREE) return false;
  for (int geom = 0; geom < model.ngeom; ++geom)
    if (model.body_weldid[model.geom_bodyid[geom]] == 0 && collides(model, geom)) return false;
  return true;
}

std::expected<LoadedModel, std::string> load_model(const config::ModelText& text, const std::string& mesh_path) {
  take_errors_and_warnings();
  const std::string& path = text.files.front();
  MendedMjcf mended = mend(text, mesh_path);
  for (std::string& note : mended.mended) note = config::in_lines_of_files(text, note);
  const Sources sources(mended.text, mesh_path);
  const MemoryFile compiled;  // a child of ours writes it
  if (!compiled.is_open())
    return std::unexpected(fmt::format("{}: no memory to read it into: {}", path, ipc::errno_text()));
  const auto done = in_bounded_child([&] { return compile_to(sources, compiled.path()); });
  if (!done)
    return std::unexpected(
        config::on_one_line(fmt::format("{}: {}", path, config::in_lines_of_files(text, done.error()))));
  if (const std::string note = sources.note(); !note.empty()) mended.mended.push_back(config::on_one_line(note));
  LoadedModel loaded{Model(mj_loadModel(compiled.path().c_str(), nullptr)), std::move(mended.mended)};
  if (!loaded.model) return std::unexpected(path + ": MuJoCo could not keep what it read; is memory full?");
  return loaded;
}

}  // namespace takt::simulation
