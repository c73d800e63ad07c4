// SPDX-License-Identifier: Apache-2.0
#include "config/model_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <utility>

#include "config/document.hpp"
#include "config/robot_text.hpp"
#include "config/xml_tags.hpp"

namespace takt::config {
namespace {

constexpr std::size_t kMostFiles = 256;

std::string without_comments(std::string text) {
  for (std::size_t at = 0; (at = text.find("<!--", at)) != std::string::npos;) {
    const std::size_t end = std::min(text.find("-->", at), text.size() - 3) + 3;
    for (; at < end; ++at)
      if (text[at] != '\n') text[at] = ' ';
  }
  return text;
}

// <include file="..."/>, or with a closing tag right behind it. `end`: behind the whole.
struct Include {
  std::string_view file;
  std::size_t begin = 0, end = 0;
};

std::optional<Include> next_include(std::string_view text, std::size_t from) {
  while (const auto tag = next_tag(text, from)) {
    from = tag->end;
    const bool is_one = tag->name == "include" && !tag->closes && tag->attributes.size() == 1 && tag->find("file");
    if (!is_one) continue;
    const std::string_view file = tag->find("file")->value;
    if (tag->is_empty) return Include{file, tag->begin, tag->end};
    const auto closing = next_tag(text, tag->end);
    const bool is_whole =
        closing && closing->closes && closing->name == "include" &&
        text.substr(tag->end, closing->begin - tag->end).find_first_not_of(" \t\r\n") == std::string_view::npos;
    if (is_whole) return Include{file, tag->begin, closing->end};
  }
  return std::nullopt;
}

std::optional<XmlTag> root_of(std::string_view text) {
  for (auto tag = next_tag(text, 0); tag; tag = next_tag(text, tag->end))
    if (!tag->closes && (tag->name == "mujoco" || tag->name == "mujocoinclude")) return tag;
  return std::nullopt;
}

class ModelReader {
 public:
  explicit ModelReader(const std::string& path) : folder_(std::filesystem::path(path).parent_path()) {}

  std::expected<ModelText, std::string> read(const std::string& path) {
    const auto text = open(path);
    std::error_code error;
    if (!text)
      return std::unexpected(
          path + (std::filesystem::exists(path, error)
                      ? ": cannot be read; name an MJCF file as simulation.mujoco.model"
                      : ": cannot be read: no such file; check the path, here or in simulation.mujoco.model"));
    model_.lines.push_back({0, 1});
    if (auto done = append(*text, 0, 1); !done) return std::unexpected(done.error());
    return std::move(model_);
  }

 private:
  std::expected<std::string, std::string> open(const std::string& path) {
    auto text = read_file(path);
    if (!text) return text;
    model_.files.push_back(path);
    return without_comments(std::move(*text));
  }

  std::expected<void, std::string> append(const std::string& text, std::size_t file, std::size_t line) {
    if (text.contains("<xacro:") || text.contains("=\"${"))
      return std::unexpected(model_.files[file] +
                             ": is xacro, which writes models: run `xacro FILE > robot.urdf`, and name robot.urdf");
    open_.push_back(model_.files[file]);
    std::size_t from = 0;
    while (const auto one = next_include(text, from)) {
      line = copy(text.substr(from, one->begin - from), file, line);
      const std::string named(one->file);
      if (auto done = include(named, fmt::format("{}:{}: includes {}", model_.files[file], line, named)); !done)
        return done;
      const std::string_view element(text.data() + one->begin, one->end - one->begin);
      line += static_cast<std::size_t>(std::ranges::count(element, '\n'));
      from = one->end;
    }
    copy(text.substr(from), file, line);
    open_.pop_back();
    return {};
  }

  std::expected<void, std::string> include(const std::string& named, const std::string& where) {
    const std::string path = (folder_ / named).lexically_normal();
    if (std::ranges::find(open_, path) != open_.end() || model_.files.size() == kMostFiles)
      return std::unexpected(where + ", which comes back to itself; take one of the two out");
    const auto text = open(path);
    if (!text) return std::unexpected(where + ", which cannot be read; files are named from the model's folder");
    const std::size_t file = model_.files.size() - 1;
    const auto root = root_of(*text);
    if (!root || root->is_empty) return {};
    const std::string name(root->name);
    const std::size_t begins = root->end;
    const std::size_t ends = text->rfind("</" + name);
    if (ends == std::string::npos || ends < begins)
      return std::unexpected(where + ", which does not end its <" + name + ">");
    const auto line = 1 + std::ranges::count(text->substr(0, begins), '\n');
    return append(text->substr(begins, ends - begins), file, static_cast<std::size_t>(line));
  }

  // Returns the line that its end stands in.
  std::size_t copy(const std::string& text, std::size_t file, std::size_t line) {
    model_.text += text;
    for (const char letter : text)
      if (letter == '\n') model_.lines.push_back({file, ++line});
    return line;
  }

  std::filesystem::path folder_;
  ModelText model_;
  std::vector<std::string> open_;  // files that include the one being read, and it
};

}  // namespace

std::expected<ModelText, std::string> read_model_text(const std::string& path) {
  auto model = ModelReader(path).read(path);
  if (!model) return std::unexpected(on_one_line(model.error()));
  return model;
}

std::vector<std::string> model_assets(const ModelText& model) {
  std::filesystem::path meshes, textures;
  for (auto tag = next_tag(model.text, 0); tag; tag = next_tag(model.text, tag->end)) {
    if (tag->name != "compiler") continue;
    if (const XmlAttribute* const both = tag->find("assetdir")) meshes = textures = both->value;
    if (const XmlAttribute* const one = tag->find("meshdir")) meshes = one->value;
    if (const XmlAttribute* const one = tag->find("texturedir")) textures = one->value;
  }
  const std::filesystem::path folder = std::filesystem::path(model.files.front()).parent_path();
  std::vector<std::string> files;
  for (auto tag = next_tag(model.text, 0); tag; tag = next_tag(model.text, tag->end)) {
    const bool is_texture = tag->name == "texture";
    if (!is_texture && tag->name != "mesh" && tag->name != "hfield" && tag->name != "skin") continue;
    for (const XmlAttribute& one : tag->attributes)
      if (one.name.starts_with("file") && !one.value.empty() && !one.value.starts_with("package://"))
        files.push_back((folder / (is_texture ? textures : meshes) / one.value).lexically_normal());
  }
  return files;
}

std::expected<std::string, std::string> model_bytes(const std::string& path) {
  const auto model = read_model_text(path);
  if (!model) return std::unexpected(model.error());
  std::string bytes;
  for (const std::string& file : model->files) {
    const auto text = read_file(file);
    if (!text) return std::unexpected(text.error());
    bytes += *text;
  }
  return bytes;
}

std::string in_lines_of_files(const ModelText& model, const std::string& sentence) {
  std::string told;
  std::size_t from = 0;
  for (std::size_t at = 0; (at = sentence.find("ine ", at)) != std::string::npos;) {
    const bool is_word = at > 0 && (sentence[at - 1] == 'l' || sentence[at - 1] == 'L');
    at += 4;
    constexpr std::string_view kNumber = "number=";
    if (sentence.compare(at, kNumber.size(), kNumber) == 0) at += kNumber.size();
    std::size_t line = 0;
    const char* const digits = sentence.data() + at;
    const auto read = std::from_chars(digits, sentence.data() + sentence.size(), line);
    if (!is_word || read.ptr == digits) continue;
    line = std::min(read.ec == std::errc{} ? line : model.lines.size(), model.lines.size());
    const ModelText::Line& stands = model.lines[line == 0 ? 0 : line - 1];
    told += fmt::format("{}{}", std::string_view(sentence).substr(from, at - from), stands.line);
    if (stands.file != 0) told += " of " + model.files[stands.file];
    from = at = static_cast<std::size_t>(read.ptr - sentence.data());
  }
  return told + sentence.substr(from);
}

}  // namespace takt::config
