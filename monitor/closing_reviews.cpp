// SPDX-License-Identifier: Apache-2.0
#include "monitor/closing_reviews.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <spdlog/spdlog.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace takt::monitor {

ClosingReviews::~ClosingReviews() {
  for (const Review& review : under_way_) is_over(review, 0);
}

std::expected<void, std::string> ClosingReviews::begin(const std::string& run_folder) {
  std::string program = "takt-monitor", option = "--review", folder = run_folder;
  const std::array<char*, 4> arguments{program.data(), option.data(), folder.data(), nullptr};
  sigset_t endings;
  sigemptyset(&endings);
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&endings, number);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  posix_spawnattr_setsigmask(&attributes, &endings);
  pid_t pid = 0;
  const int fault = posix_spawn(&pid, "/proc/self/exe", nullptr, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  if (fault != 0)
    return std::unexpected(
        fmt::format("metrics.json is missing: no process to write it: {}; `takt-monitor --review {}` does",
                    std::strerror(fault), run_folder));
  under_way_.push_back({pid, run_folder});
  return {};
}

void ClosingReviews::look() {
  std::erase_if(under_way_, [](const Review& review) { return is_over(review, WNOHANG); });
}

bool ClosingReviews::is_over(const Review& review, int options) {
  int status = 0;
  pid_t ended = 0;
  do {
    ended = waitpid(review.pid, &status, options);
  } while (ended < 0 && errno == EINTR);
  if (ended == 0) return false;
  if (ended < 0 || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    spdlog::warn("metrics.json is missing: its writer ended early; `takt-monitor --review {}` is another",
                 review.run_folder);
  return true;
}

}  // namespace takt::monitor
