// SPDX-License-Identifier: Apache-2.0
#include "config/based_on.hpp"

#include <fmt/format.h>

#include <filesystem>

namespace takt::config {
namespace {

void set_in_base(Node& node) {
  node.place.in_base = true;
  for (Node& item : node.items) set_in_base(item);
  for (Entry& entry : node.entries) {
    entry.key.place.in_base = true;
    set_in_base(entry.value);
  }
}

}  // namespace

void add_base(Node& root, const std::string& file, Problems& problems) {
  Entry* const given = root.entry_of(kBasedOn);
  if (given == nullptr) return;
  const Node name = std::move(given->value);
  root.entries.erase(root.entries.begin() + (given - root.entries.data()));
  const auto refuse = [&](const std::string& sentence) {
    problems.add(name.place, fmt::format("{}: {}", kBasedOn, sentence));
  };
  if (name.kind != Node::Kind::scalar)
    return refuse(fmt::format("holds {}; write the name of a robot file", kind_name(name.kind)));
  if (name.text.contains('/'))
    return refuse(fmt::format("{} is a path; name a file in this folder: paths in it begin there", name.text));
  const std::string path = (std::filesystem::path(file).parent_path() / name.text).string();
  const auto text = read_file(path);
  if (!text) return refuse(text.error());
  Problems of_base(path);
  Node base = read_document(*text, Tags::refuse, of_base);
  if (!of_base.empty()) return refuse(of_base.text());
  if (base.kind != Node::Kind::map) return refuse(path + " holds no robot; name another file");
  if (const Node* const deeper = base.find(kBasedOn))
    return refuse(
        fmt::format("{} is based on {} itself; name that one, and say the differences here", path, deeper->text));
  set_in_base(base);
  problems.set_base(path);
  root.add_missing(base);
}

}  // namespace takt::config
