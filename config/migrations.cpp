// SPDX-License-Identifier: Apache-2.0
#include "config/migrations.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

namespace takt::config {
namespace {

constexpr std::array kMigrations{
    Migration{"control.overrun_limit", "", "0.2",
              "write control.late_share: the share of freshness.window's periods that may be late, 0.25 where it is "
              "left out; consecutive late ticks alone are not counted any more"},
    Migration{"stops.*.fallback", "", "0.2",
              "leave it out: no stop leads the robot to a pose; degraded.fallback does, in degraded mode"},
    Migration{"stops.*.how", "posture", "0.2",
              "write hold: no stop leads the robot to a pose; degraded.fallback does, in degraded mode", "hold"},
};

// Name by name.
bool is_like(std::string_view path, std::string_view pattern) {
  while (true) {
    const std::size_t end = path.find('.'), end_of_pattern = pattern.find('.');
    const std::string_view wanted = pattern.substr(0, end_of_pattern);
    if (wanted != "*" && path.substr(0, end) != wanted) return false;
    const bool is_last = end == std::string_view::npos, is_last_of_pattern = end_of_pattern == std::string_view::npos;
    if (is_last || is_last_of_pattern) return is_last && is_last_of_pattern;
    path.remove_prefix(end + 1);
    pattern.remove_prefix(end_of_pattern + 1);
  }
}

void migrate(Node& node, const std::string& path) {
  if (const Migration* const gone = node.kind == Node::Kind::scalar ? migration_of(path, node.text) : nullptr;
      gone != nullptr && !gone->recorded_as.empty())
    node.text = gone->recorded_as;
  for (std::size_t i = 0; i < node.items.size(); ++i) migrate(node.items[i], path + "[" + std::to_string(i) + "]");
  const std::string below = path.empty() ? "" : path + ".";
  std::erase_if(node.entries, [&](const Entry& entry) { return migration_of(below + entry.key.text) != nullptr; });
  for (Entry& entry : node.entries) migrate(entry.value, below + entry.key.text);
}

}  // namespace

void migrate_recorded(Node& root) {
  migrate(root, "");
}

const Migration* migration_of(std::string_view path, std::string_view word) {
  const auto* const found = std::ranges::find_if(
      kMigrations, [&](const Migration& one) { return one.word == word && is_like(path, one.path); });
  return found == kMigrations.end() ? nullptr : found;
}

}  // namespace takt::config
