// SPDX-License-Identifier: Apache-2.0
#include "config/joint_defaults.hpp"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>

namespace takt::config {
namespace {

constexpr std::string_view kWhose = "joints";

void places_in(const Node& node, std::vector<Place>& places) {
  places.push_back(node.place);
  for (const Node& item : node.items) places_in(item, places);
  for (const Entry& entry : node.entries) {
    places.push_back(entry.key.place);
    places_in(entry.value, places);
  }
}

// Takes the patterns out of the block; empty: a problem was added.
std::vector<std::string> take_patterns(Node& block, const std::string& path, Problems& problems) {
  Entry* const whose = block.kind == Node::Kind::map ? block.entry_of(kWhose) : nullptr;
  std::vector<std::string> patterns;
  if (whose != nullptr)
    for (const Node& item : whose->value.items)
      if (item.kind == Node::Kind::scalar) patterns.push_back(item.text);
  if (patterns.empty())
    problems.add(block.place, fmt::format("{}: says not which joints it is for; add `{}: [\"*_hip\"]`", path, kWhose));
  if (whose != nullptr) block.entries.erase(block.entries.begin() + (whose - block.entries.data()));
  if (const Entry* const name = block.kind == Node::Kind::map ? block.entry_of("name") : nullptr) {
    problems.add(name->key.place, fmt::format("{}.name: is each joint's own; remove it here", path));
    block.entries.erase(block.entries.begin() + (name - block.entries.data()));
  }
  return patterns;
}

std::vector<Node*> joints_that_fit(Node& joints, const std::vector<std::string>& patterns, const Node& block,
                                   const std::string& path, Problems& problems) {
  std::vector<Node*> found;
  for (const std::string& pattern : patterns) {
    bool fits = false;
    for (Node& joint : joints.items) {
      const Node* const name = joint.find("name");
      if (name == nullptr || fnmatch(pattern.c_str(), name->text.c_str(), 0) != 0) continue;
      fits = true;
      if (std::ranges::find(found, &joint) == found.end()) found.push_back(&joint);
    }
    if (!fits)
      problems.add(block.place, fmt::format("{}.{}: no joint is called `{}`; correct the pattern or remove it", path,
                                            kWhose, pattern));
  }
  return found;
}

}  // namespace

void spread_joint_defaults(Node& root, Problems& problems) {
  Entry* const given = root.entry_of(kJointDefaults);
  if (given == nullptr) return;
  Node blocks = std::move(given->value);
  root.entries.erase(root.entries.begin() + (given - root.entries.data()));
  Entry* const joints = root.entry_of("joints");
  if (blocks.kind != Node::Kind::sequence)
    return problems.add(blocks.place, fmt::format("{}: holds {}; write a list, one `- ` per block", kJointDefaults,
                                                  kind_name(blocks.kind)));
  if (joints == nullptr) return;
  for (std::size_t i = blocks.items.size(); i-- > 0;) {
    Node& block = blocks.items[i];
    const std::string path = fmt::format("{}[{}]", kJointDefaults, i);
    const auto patterns = take_patterns(block, path, problems);
    const auto fitting = joints_that_fit(joints->value, patterns, block, path, problems);
    if (fitting.empty()) continue;
    for (Node* const joint : fitting) joint->add_missing(block);
    std::vector<Place> places;
    places_in(block, places);
    problems.share(places, fmt::format("{}, {} joint{} from {}", path, fitting.size(), fitting.size() == 1 ? "" : "s",
                                       fitting.front()->find("name")->text));
  }
}

}  // namespace takt::config
