// SPDX-License-Identifier: Apache-2.0
#include "simulation/mjcf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "config/xml_tags.hpp"
#include "simulation/mjcf_frames.hpp"
#include "simulation/mjcf_newer.hpp"

namespace takt::simulation {
namespace {

template <class Visit>
void for_each_tag(std::string_view text, const Visit& visit) {
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) visit(*tag);
}

bool has_attribute(const std::string& text, std::string_view attribute) {
  bool found = false;
  for_each_tag(text, [&](const config::XmlTag& tag) { found = found || tag.find(attribute) != nullptr; });
  return found;
}

// Puts an attribute into the first element of that name, or into a new one right inside <mujoco>.
void set_attribute(std::string& text, const std::string& element, const std::string& attribute,
                   const std::string& value) {
  const std::string written = fmt::format(" {}=\"{}\"", attribute, value);
  std::optional<std::size_t> inside, behind_root;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    if (tag.closes) return;
    if (tag.name == element && !inside) inside = tag.begin + 1 + element.size();
    if (tag.name == "mujoco" && !behind_root) behind_root = tag.end;
  });
  if (inside)
    text.insert(*inside, written);
  else if (behind_root)
    text.insert(*behind_root, fmt::format("<{}{}/>", element, written));
}

void make_absolute(std::string& text, std::string_view attribute, const std::string& folder) {
  std::string made;
  std::size_t from = 0;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    const config::XmlAttribute* const named = tag.find(attribute);
    if (named == nullptr) return;
    const auto begin = static_cast<std::size_t>(named->value.data() - text.data());
    made += text.substr(from, begin - from);
    made += (std::filesystem::path(folder) / named->value).lexically_normal();
    from = begin + named->value.size();
  });
  text = made + text.substr(from);
}

// Newer files name one folder for both.
void divide_assetdir(std::string& text) {
  const bool has_meshes = has_attribute(text, "meshdir"), has_textures = has_attribute(text, "texturedir");
  std::string made;
  std::size_t from = 0;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    const config::XmlAttribute* const both = tag.name == "compiler" ? tag.find("assetdir") : nullptr;
    if (both == nullptr) return;
    made += text.substr(from, both->begin - from);
    if (!has_meshes) made += fmt::format("meshdir=\"{}\" ", both->value);
    if (!has_textures) made += fmt::format("texturedir=\"{}\" ", both->value);
    from = both->end;
  });
  text = made + text.substr(from);
}

constexpr std::string_view kPackage = "package://";

bool path_exists(const std::filesystem::path& file) {
  std::error_code none;
  return std::filesystem::exists(file, none);
}

// The first of them that is there, else `otherwise`.
std::filesystem::path first_of(std::initializer_list<std::filesystem::path> files,
                               const std::filesystem::path& otherwise) {
  const auto* const found = std::ranges::find_if(files, path_exists);
  return found == files.end() ? otherwise : *found;
}

// Where a mesh of a URDF lies. A package is a folder of its name: one that the file is in, or beside one of these.
std::filesystem::path mesh_file(std::string_view named, const std::filesystem::path& folder,
                                const std::filesystem::path& elsewhere) {
  constexpr std::string_view kFile = "file://";
  if (named.starts_with(kFile)) named.remove_prefix(kFile.size());
  const std::filesystem::path plain(named);
  if (!named.starts_with(kPackage)) {
    std::filesystem::path here = (folder / plain).lexically_normal();
    if (elsewhere.empty()) return here;
    return first_of({here, elsewhere / plain.relative_path(), elsewhere / plain.filename()}, here);
  }
  const std::filesystem::path within(named.substr(kPackage.size()));
  if (within.empty()) return folder;
  const std::filesystem::path package = *within.begin(), rest = within.lexically_relative(package);
  for (std::filesystem::path around = folder; around.has_relative_path(); around = around.parent_path()) {
    if (around.filename() == package) return around / rest;
    if (path_exists(around / package / rest)) return around / package / rest;
  }
  if (elsewhere.empty()) return folder / rest;
  return first_of({elsewhere / within, elsewhere / rest, elsewhere / within.filename()}, folder / rest);
}

// A link between two joints without mass or shape is usual in URDFs, and refused by MuJoCo.
void weigh_bare_links(std::string& text) {
  const std::string inertial = fmt::format(
      R"(<inertial><mass value="{0}"/><inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>)",
      kLeastLinkMass, kLeastLinkInertia);
  std::vector<std::pair<std::size_t, bool>> bare;  // where it ends; whether it is <link/>
  std::size_t depth = 0;                           // 1: in the robot
  bool has_weight = false;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    depth -= tag.closes && depth > 0 ? 1U : 0U;
    const bool is_link = depth == 1 && tag.name == "link";
    if (is_link && tag.is_empty) bare.emplace_back(tag.end, true);
    if (is_link && tag.closes && !has_weight) bare.emplace_back(tag.begin, false);
    if (is_link) has_weight = false;
    if (tag.name == "inertial" || tag.name == "collision") has_weight = true;
    depth += tag.closes || tag.is_empty ? 0U : 1U;
  });
  std::string made;
  std::size_t from = 0;
  for (const auto& [at, is_empty] : bare) {
    made += text.substr(from, at - from - (is_empty ? 2 : 0)) + (is_empty ? ">" : "") + inertial +
            (is_empty ? "</link>" : "");
    from = at;
  }
  text = made + text.substr(from);
}

// Meshes by whole paths: MuJoCo looks for the name alone, in the folder of the file that it is given.
void complete_urdf(std::string& text, const std::string& folder, const std::string& mesh_path) {
  std::string made;
  std::size_t from = 0;
  bool has_mujoco = false;
  std::size_t behind_root = 0;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    has_mujoco = has_mujoco || tag.name == "mujoco";
    if (tag.name == "robot" && !tag.closes && behind_root == 0) behind_root = tag.end;
  });
  if (has_mujoco || behind_root == 0) return;
  weigh_bare_links(text);
  for_each_tag(text, [&](const config::XmlTag& tag) {
    if (tag.begin >= behind_root && from < behind_root) {
      made += text.substr(from, behind_root - from) + R"(<mujoco><compiler strippath="false"/></mujoco>)";
      from = behind_root;
    }
    const config::XmlAttribute* const named = tag.name == "mesh" ? tag.find("filename") : nullptr;
    if (named == nullptr) return;
    const auto begin = static_cast<std::size_t>(named->value.data() - text.data());
    made += text.substr(from, begin - from);
    made += mesh_file(named->value, folder, mesh_path).string();
    from = begin + named->value.size();
  });
  text = made + text.substr(from);
}

}  // namespace

MendedMjcf mend_mjcf(std::string text, const std::string& folder, const std::string& mesh_path) {
  MendedMjcf file{std::move(text), {}};
  file.mended = leave_out_newer(file.text);
  if (UnfoldedFrames unfolded = unfold_frames(file.text); unfolded.count > 0) {
    file.text = std::move(unfolded.text);
    file.mended.push_back(
        fmt::format("{} <frame> of newer versions taken out, the first in line {}: what stands in one "
                    "has its place, orientation and class now",
                    unfolded.count, unfolded.first_line));
  }
  divide_assetdir(file.text);
  complete_urdf(file.text, folder, mesh_path);
  if (!has_attribute(file.text, "autolimits")) {
    set_attribute(file.text, "compiler", "autolimits", "true");
    file.mended.emplace_back("autolimits=\"true\" set, as newer versions of MuJoCo have it by themselves");
  }
  for (const char* directory : {"meshdir", "texturedir"}) {
    if (has_attribute(file.text, directory))
      make_absolute(file.text, directory, folder);
    else
      set_attribute(file.text, "compiler", directory, folder);
  }
  return file;
}

}  // namespace takt::simulation
