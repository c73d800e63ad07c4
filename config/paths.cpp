// SPDX-License-Identifier: Apache-2.0
#include "config/paths.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace takt::config {

std::string runtime_home() {
  const char* const set = std::getenv("XDG_RUNTIME_DIR");
  if (set != nullptr && *set == '/') return std::string(set) + "/takt";
  if (geteuid() == 0) return kServiceRuntimeDirectory;
  const std::string user = std::to_string(geteuid());
  std::error_code error;
  if (std::filesystem::is_directory("/run/user/" + user, error)) return "/run/user/" + user + "/takt";
  return "/tmp/takt-" + user;
}

std::string default_runtime_directory(const std::string& robot) {
  return runtime_home() + "/" + robot;
}

}  // namespace takt::config
