// SPDX-License-Identifier: Apache-2.0
// What a panel was computed from, into its artifact and out of it again (lab/artifact/inputs.hpp): robot files
// with every default of the panel's program left out, policies with their weights, models with what they include and
// the meshes, height fields and textures that they name. Engines of plugins are named, and not kept.
//
// Errors are one sentence. Thread rule: one thread.
#pragma once

#include <expected>
#include <map>
#include <string>

#include "lab/artifact/artifact.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

// The files that a command for /bin/sh names, as far as its words are paths; its program, if a path says which. What
// those import is not seen.
OutsideProgram outside_program(const std::string& command);

// Nothing where it is done already. Precondition: the folder is that of the contest's artifact.
std::expected<void, std::string> keep_inputs(const Contest& contest, const ArtifactFolder& folder);

// A temporary folder with the kept files, where their robot files find them; gone with this object.
class UnpackedInputs {
 public:
  static std::expected<UnpackedInputs, std::string> unpack(const ArtifactFolder& folder);
  UnpackedInputs(UnpackedInputs&& other) noexcept;
  UnpackedInputs& operator=(UnpackedInputs&&) = delete;
  UnpackedInputs(const UnpackedInputs&) = delete;
  UnpackedInputs& operator=(const UnpackedInputs&) = delete;
  ~UnpackedInputs();

  [[nodiscard]] const std::map<std::string, std::string>& robots() const { return robots_; }  // by task

 private:
  explicit UnpackedInputs(std::string path) : path_(std::move(path)) {}
  std::string path_;
  std::map<std::string, std::string> robots_;
};

}  // namespace takt::lab
