// SPDX-License-Identifier: Apache-2.0
// The text of a robot's model (MJCF, URDF) as one: what it includes stands where it is included, as MuJoCo reads it,
// and comments are blank. Errors: one sentence, "FILE:LINE: what; how to correct it".
#pragma once

#include <cstddef>
#include <expected>
#include <string>
#include <vector>

namespace takt::config {

struct ModelText {
  struct Line {
    std::size_t file = 0;  // index into `files`
    std::size_t line = 0;  // from 1
  };
  std::string text;
  std::vector<std::string> files;  // the model's own, then each that is included, in the order of reading
  std::vector<Line> lines;         // where each line of `text` begins
};

// Included files are named from the model's folder, whichever file includes them.
std::expected<ModelText, std::string> read_model_text(const std::string& path);

// The bytes of all of the model's files, which tell one model from another: of a model that is one file, that file's.
std::expected<std::string, std::string> model_bytes(const std::string& path);

// Meshes, height fields, skins and textures that the model names, where MuJoCo looks for them. What a URDF finds by
// package:// is left out.
std::vector<std::string> model_assets(const ModelText& model);

// `sentence` speaks of lines of the text ("line 12", "Line number=12"): the same of lines of the files.
std::string in_lines_of_files(const ModelText& model, const std::string& sentence);

}  // namespace takt::config
