// SPDX-License-Identifier: Apache-2.0
#include "config/file_kind.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>

#include "config/nearest.hpp"

namespace takt::config {
namespace {

struct FileKind {
  std::string_view name, contents, what, use;  // `use`: {} is the file
};

constexpr std::array kKinds{
    FileKind{"takt.robot", "robot", "a robot file", "check it: takt config check {}"},
    FileKind{"takt.panel", "panel", "a panel", "run it: takt panel run {} --out DIR"},
    FileKind{"takt.scenario", "scenario", "a scenario", "play it: takt run ROBOT --plant=--scenario={}"},
    FileKind{"takt.devices", "devices", "a devices file", "simulate it: takt-plant --devices {}"},
};

std::string_view kind_of(std::string_view schema) {
  return schema.substr(0, schema.find('/'));
}

const FileKind* find_kind(std::string_view schema) {
  const auto* const found = std::ranges::find(kKinds, kind_of(schema), &FileKind::name);
  return found == kKinds.end() ? nullptr : found;
}

}  // namespace

void expect_kind(const Node& root, std::string_view schema, const std::string& file, Problems& problems) {
  const FileKind* const wanted = find_kind(schema);
  if (wanted == nullptr) return;
  if (root.kind != Node::Kind::map)
    return problems.add(root.place, fmt::format("holds no {}; begin with `schema: {}`", wanted->contents, schema));
  const Node* const given = root.find("schema");
  if (given == nullptr || given->kind != Node::Kind::scalar) return;
  const std::string_view kind = kind_of(given->text);
  if (!kind.starts_with("takt.") || !nearest(kind, std::span(&wanted->name, 1)).empty()) return;
  const FileKind* const other = find_kind(given->text);
  problems.add(given->place, other == nullptr ? fmt::format("is {}, not {} ({}); name another file", given->text,
                                                            wanted->what, schema)
                                              : fmt::format("is {} ({}), not {}; {}", other->what, given->text,
                                                            wanted->what, fmt::format(fmt::runtime(other->use), file)));
}

}  // namespace takt::config
