// SPDX-License-Identifier: Apache-2.0
#include "simulation/mesh_files.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "config/xml_tags.hpp"

namespace takt::simulation {
namespace {

namespace fs = std::filesystem;
using config::XmlAttribute;
using config::XmlTag;

bool is_there(const fs::path& file) {
  std::error_code none;
  return fs::exists(file, none);
}

struct Folders {
  fs::path meshes, textures;
  bool names_only = false;  // strippath
};

Folders folders_of(const std::string& text) {
  Folders folders;
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) {
    if (tag->name != "compiler") continue;
    if (const XmlAttribute* const folder = tag->find("meshdir")) folders.meshes = folder->value;
    if (const XmlAttribute* const folder = tag->find("texturedir")) folders.textures = folder->value;
    if (const XmlAttribute* const strip = tag->find("strippath")) folders.names_only = strip->value == "true";
  }
  return folders;
}

fs::path named(const fs::path& folder, std::string_view file, bool name_only) {
  const fs::path path(file);
  return folder / (name_only ? path.filename() : path);
}

class MeshSearch {
 public:
  MeshSearch(const std::string& text, const std::string& mesh_path, const std::string& stand_in)
      : text_(text), folders_(folders_of(text)), mesh_path_(mesh_path), stand_in_(stand_in) {}

  MeshFiles run() {
    for (auto tag = config::next_tag(text_, 0); tag; tag = config::next_tag(text_, tag->end)) {
      const XmlAttribute* const file = tag->closes ? nullptr : tag->find("file");
      if (file == nullptr) continue;
      if (tag->name == "mesh") look_for_mesh(*tag, *file);
      if (tag->name == "texture" && !stand_in_.empty() &&
          !is_there(named(folders_.textures, file->value, folders_.names_only)))
        replace(*file, R"(builtin="flat" width="4" height="4" rgb1="0.5 0.5 0.5")");
    }
    found_.text += text_.substr(copied_);
    return std::move(found_);
  }

 private:
  void look_for_mesh(const XmlTag& tag, const XmlAttribute& file) {
    if (is_there(named(folders_.meshes, file.value, folders_.names_only))) return;
    std::string shape = stand_in_;
    if (const auto elsewhere = under_mesh_path(file.value))
      shape = fmt::format(R"(file="{}")", elsewhere->string());
    else
      found_.missing.emplace_back(file.value);
    if (shape.empty()) return;
    // Without a name a mesh is called as its file is.
    const std::string name = tag.find("name") ? "" : fmt::format(R"(name="{}" )", fs::path(file.value).stem().string());
    replace(file, name + shape);
  }

  [[nodiscard]] std::optional<fs::path> under_mesh_path(std::string_view file) const {
    if (mesh_path_.empty()) return std::nullopt;
    for (const fs::path& path : {mesh_path_ / fs::path(file), mesh_path_ / fs::path(file).filename()})
      if (is_there(path)) return fs::absolute(path).lexically_normal();
    return std::nullopt;
  }

  void replace(const XmlAttribute& attribute, const std::string& by) {
    found_.text += text_.substr(copied_, attribute.begin - copied_) + by;
    copied_ = attribute.end;
  }

  const std::string& text_;
  Folders folders_;
  fs::path mesh_path_;
  std::string stand_in_;
  MeshFiles found_;
  std::size_t copied_ = 0;
};

}  // namespace

MeshFiles find_mesh_files(const std::string& text, const std::string& mesh_path, const std::string& stand_in) {
  return MeshSearch(text, mesh_path, stand_in).run();
}

std::string stand_in_mesh(double size) {
  return fmt::format(R"(vertex="0 0 0 {0} 0 0 0 {0} 0 0 0 {0}")", size);
}

}  // namespace takt::simulation
