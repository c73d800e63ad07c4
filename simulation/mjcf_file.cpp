// SPDX-License-Identifier: Apache-2.0
#include "simulation/mjcf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>

#include "config/xml_tags.hpp"

namespace takt::plant {
namespace {

std::ptrdiff_t line_of(const std::string& text, std::size_t at) {
  return 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
}

std::string only_newlines(const std::string& text) {
  return std::string(static_cast<std::size_t>(std::ranges::count(text, '\n')), '\n');
}

bool is_space(char letter) {
  return std::string_view(" \t\n\v\f\r").find(letter) != std::string_view::npos;
}

template <class Visit>
void for_each_tag(std::string_view text, const Visit& visit) {
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) visit(*tag);
}

struct Span {
  std::size_t begin = 0, end = 0;
};

// Takes the spans out, in the order in which they stand, newlines kept; `what` names them.
void take_out(MendedMjcf& file, const std::vector<Span>& spans, const std::string& what) {
  if (spans.empty()) return;
  const std::ptrdiff_t first_line = line_of(file.text, spans.front().begin);
  std::string kept;
  std::size_t from = 0;
  for (const Span& span : spans) {
    kept +=
        file.text.substr(from, span.begin - from) + only_newlines(file.text.substr(span.begin, span.end - span.begin));
    from = span.end;
  }
  file.text = kept + file.text.substr(from);
  file.mended.push_back(
      fmt::format("{} left out, {} times, first in line {}: MuJoCo 2.2.2 does not know it, and the drives' own "
                  "torque limits hold",
                  what, spans.size(), first_line));
}

// Each with the spaces before it.
std::vector<Span> attributes_that_bound_forces(const std::string& text) {
  std::vector<Span> spans;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    for (const config::XmlAttribute& attribute : tag.attributes) {
      if (attribute.name != "actuatorfrcrange" && attribute.name != "actuatorfrclimited") continue;
      Span span{attribute.begin, attribute.end};
      while (span.begin > tag.begin && is_space(text[span.begin - 1])) --span.begin;
      spans.push_back(span);
    }
  });
  return spans;
}

std::vector<Span> sensors_of_joint_forces(const std::string& text) {
  std::vector<Span> spans;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    if (tag.name == "jointactuatorfrc" && tag.is_empty) spans.push_back({tag.begin, tag.end});
  });
  return spans;
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

constexpr std::string_view kPackage = "package://";

// Where a mesh of a URDF lies. A package is a folder of its name: one that the file is in, or beside one of these.
std::filesystem::path mesh_file(std::string_view named, const std::filesystem::path& folder) {
  if (!named.starts_with(kPackage)) return (folder / named).lexically_normal();
  const std::filesystem::path within(named.substr(kPackage.size()));
  const std::filesystem::path package = *within.begin(), rest = within.lexically_relative(package);
  for (std::filesystem::path around = folder; around.has_relative_path(); around = around.parent_path()) {
    if (around.filename() == package) return around / rest;
    if (std::error_code none; std::filesystem::exists(around / package / rest, none)) return around / package / rest;
  }
  return folder / rest;
}

// Meshes by whole paths: MuJoCo looks for the name alone, in the folder of the file that it is given.
void complete_urdf(std::string& text, const std::string& folder) {
  std::string made;
  std::size_t from = 0;
  bool has_mujoco = false;
  std::size_t behind_root = 0;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    has_mujoco = has_mujoco || tag.name == "mujoco";
    if (tag.name == "robot" && !tag.closes && behind_root == 0) behind_root = tag.end;
  });
  if (has_mujoco || behind_root == 0) return;
  for_each_tag(text, [&](const config::XmlTag& tag) {
    if (tag.begin >= behind_root && from < behind_root) {
      made += text.substr(from, behind_root - from) + R"(<mujoco><compiler strippath="false"/></mujoco>)";
      from = behind_root;
    }
    const config::XmlAttribute* const named = tag.name == "mesh" ? tag.find("filename") : nullptr;
    if (named == nullptr) return;
    const auto begin = static_cast<std::size_t>(named->value.data() - text.data());
    made += text.substr(from, begin - from);
    made += mesh_file(named->value, folder).string();
    from = begin + named->value.size();
  });
  text = made + text.substr(from);
}

}  // namespace

MendedMjcf mend_mjcf(std::string text, const std::string& folder) {
  MendedMjcf file{std::move(text), {}};
  take_out(file, attributes_that_bound_forces(file.text), "a joint's actuatorfrcrange");
  take_out(file, sensors_of_joint_forces(file.text), "a sensor jointactuatorfrc");
  complete_urdf(file.text, folder);
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

}  // namespace takt::plant
