// SPDX-License-Identifier: Apache-2.0
#include "simulation/mesh_files.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "config/xml_tags.hpp"

namespace takt::plant {
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
    std::string path = stand_in_;
    if (const auto elsewhere = under_mesh_path(file.value))
      path = elsewhere->string();
    else
      found_.missing.emplace_back(file.value);
    if (path.empty()) return;
    // Without a name a mesh is called as its file is.
    const std::string name = tag.find("name") ? "" : fmt::format(R"(name="{}" )", fs::path(file.value).stem().string());
    replace(file, fmt::format(R"({}file="{}")", name, path));
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

std::string stand_in_mesh(float size) {
  constexpr std::array<std::array<int, 3>, 4> kFaces{{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  const std::array<std::array<float, 3>, 4> corners{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}}};
  std::string bytes(80, ' ');
  const auto put = [&bytes](const auto& value) {
    std::array<char, sizeof value> raw{};
    std::memcpy(raw.data(), &value, sizeof value);
    bytes.append(raw.data(), raw.size());
  };
  put(std::uint32_t{kFaces.size()});
  for (const auto& face : kFaces) {
    put(std::array<float, 3>{0, 0, 1});  // the normal, which is not read
    for (const int corner : face) put(corners[static_cast<std::size_t>(corner)]);
    put(std::uint16_t{0});
  }
  return bytes;
}

}  // namespace takt::plant
