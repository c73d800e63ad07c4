// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/trace_folders.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

namespace takt::lab {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSnapshot = "snapshot-";

// First part of `path` below `root`, when it is a snapshot's folder.
std::string snapshot_of(const fs::path& path, const fs::path& root) {
  const fs::path below = path.lexically_relative(root);
  const std::string first = below.empty() ? std::string() : below.begin()->string();
  return first.starts_with(kSnapshot) ? first : std::string();
}

}  // namespace

std::expected<std::vector<std::string>, std::string> trace_folders(const std::string& directory) {
  std::error_code error;
  if (!fs::is_directory(directory, error))
    return std::unexpected(fmt::format("{} is not a folder; name what takt trace start wrote into", directory));
  std::vector<std::string> found;
  std::set<std::string> snapshots;
  if (fs::exists(fs::path(directory) / "metadata")) found.push_back(directory);
  const auto options = fs::directory_options::skip_permission_denied;
  for (auto entry = fs::recursive_directory_iterator(directory, options, error);
       entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (error) return std::unexpected(fmt::format("{}: {}", directory, error.message()));
    if (!entry->is_directory(error) || !fs::exists(entry->path() / "metadata")) continue;
    found.push_back(entry->path().string());
    if (std::string name = snapshot_of(entry->path(), directory); !name.empty()) snapshots.insert(std::move(name));
  }
  if (found.empty())
    return std::unexpected(
        fmt::format("{} holds no trace (no file `metadata` below it); has it been stopped?", directory));
  if (snapshots.size() > 1)
    return std::unexpected(fmt::format("{} holds {} snapshots; name one of them: {}/{}", directory, snapshots.size(),
                                       directory, *snapshots.rbegin()));
  std::ranges::sort(found);
  return found;
}

}  // namespace takt::lab
