// SPDX-License-Identifier: Apache-2.0
#include "policy_host/leapp/beside.hpp"

#include <fmt/format.h>

#include <system_error>

namespace takt::policy_host {

namespace fs = std::filesystem;

std::expected<fs::path, std::string> path_beside(const std::string& bundle, const std::string& key,
                                                 const std::string& name) {
  const auto refuse = [&](const char* what) {
    return std::unexpected(fmt::format(
        "{}: {} {} {}; put the file beside the bundle, and export it with its name alone", bundle, key, name, what));
  };
  const bool plain = !name.empty() && name.find('\0') == std::string::npos && name != "." && name != ".." &&
                     fs::path(name).filename() == name;
  if (!plain) return refuse("is not beside it");
  const fs::path folder = fs::path(bundle).parent_path();
  std::error_code error;
  const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path file = fs::canonical(root / name, error);
  if (error) return folder / name;
  if (!fs::is_regular_file(file, error)) return refuse("is not a regular file");
  if (file.parent_path() != root) return refuse("is a link that leaves its folder");
  return folder / name;
}

}  // namespace takt::policy_host
