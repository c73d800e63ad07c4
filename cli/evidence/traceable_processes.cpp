// SPDX-License-Identifier: Apache-2.0
#include "cli/evidence/traceable_processes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <system_error>

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> kPrograms{"takt-executive", "takt-monitor", "takt-policy-host"};

pid_t pid_of(const std::string& name) {
  pid_t pid = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), pid);
  return error == std::errc{} && end == name.data() + name.size() ? pid : 0;
}

}  // namespace

std::vector<TraceableProcess> traceable_processes() {
  std::vector<TraceableProcess> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator("/proc", error)) {
    const pid_t pid = pid_of(entry.path().filename());
    if (pid == 0) continue;
    const std::string program = fs::read_symlink(entry.path() / "exe", error).filename();
    if (std::ranges::find(kPrograms, program) != kPrograms.end()) found.push_back({pid, program});
  }
  return found;
}

bool is_registered(std::string_view listing, pid_t pid) {
  return listing.find(fmt::format("PID: {} ", pid)) != std::string_view::npos;
}

}  // namespace takt::cli
