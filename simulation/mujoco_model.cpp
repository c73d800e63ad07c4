// SPDX-License-Identifier: Apache-2.0
#include "simulation/mujoco_model.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <utility>

#include "simulation/mjcf_file.hpp"

namespace takt::plant {
namespace {

// By itself MuJoCo writes a file into the working directory and goes on from the initial state.
void keep_quiet() {
  mju_user_warning = [](const char*) {};
}

// MuJoCo reads files; this one lives as long as the object.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text)
      : path_(std::filesystem::temp_directory_path() / "takt-mjcf-XXXXXX.xml") {
    const int file = mkstemps(path_.data(), 4);
    if (file >= 0) close(file);
    std::ofstream(path_) << text;
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() { unlink(path_.c_str()); }
  [[nodiscard]] const char* path() const { return path_.c_str(); }

 private:
  std::string path_;
};

}  // namespace

std::expected<LoadedModel, std::string> load_model(const config::ModelText& text) {
  keep_quiet();
  const std::string& path = text.files.front();
  MendedMjcf mended = mend_mjcf(text.text, std::filesystem::absolute(path).parent_path().lexically_normal().string());
  for (std::string& note : mended.mended) note = config::in_lines_of_files(text, note);
  char error[1000] = "";
  const TemporaryFile copy(mended.text);
  LoadedModel loaded{std::unique_ptr<mjModel, DeleteModel>(mj_loadXML(copy.path(), nullptr, error, sizeof error)),
                     std::move(mended.mended)};
  if (loaded.model) return loaded;
  std::string sentence = config::in_lines_of_files(text, error);
  std::ranges::replace(sentence, '\n', ' ');
  const bool is_unknown = sentence.find("unrecognized") != std::string::npos;
  return std::unexpected(fmt::format("{}: MuJoCo {} refuses it: {}{}", path, mj_versionString(), sentence,
                                     is_unknown ? "; take it out, or play the model in a newer version as a world of "
                                                  "your own (docs/world-protocol.md)"
                                                : ""));
}

}  // namespace takt::plant
