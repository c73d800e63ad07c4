// SPDX-License-Identifier: Apache-2.0
#include "cli/run/own_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string_view>

#include "cli/run/external_tool.hpp"

namespace takt::cli {
namespace {

constexpr int kAnswered = 0;

void write_all(int to, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = write(to, text.data(), text.size());
    if (written <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

// The answer's first byte: + fine, - refused.
[[noreturn]] void answer(int to, const std::function<std::expected<std::string, std::string>()>& work,
                         const policy_host::Grants& grants, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(kExitFailed);
  (void)policy_host::go_behind_boundary(grants);  // a kernel without one of its layers checks policies all the same
  prctl(PR_SET_PDEATHSIG, SIGKILL);               // new credentials may have none
  try {
    const auto done = work();
    write_all(to, done ? "+" + *done : "-" + done.error());
  } catch (const std::exception& error) {
    fmt::print(stderr, "takt: {}\n", error.what());
    _exit(kExitInternal);
  }
  std::fflush(nullptr);
  _exit(kAnswered);
}

Refusal why_silent(int status) {
  if (WIFEXITED(status)) return {WEXITSTATUS(status) == kAnswered ? kExitFailed : WEXITSTATUS(status), ""};
  const char* const signal = sigabbrev_np(WTERMSIG(status));
  return {kExitFailed, fmt::format("the policy could not be tried: the process that loaded it was killed by SIG{}",
                                   signal != nullptr ? signal : "?")};
}

}  // namespace

std::expected<std::string, Refusal> in_own_process(const std::function<std::expected<std::string, std::string>()>& work,
                                                   int refused, const policy_host::Grants& grants) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    return std::unexpected(Refusal{kExitFailed, fmt::format("no pipe: {}; close some files", std::strerror(errno))});
  std::fflush(nullptr);
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid == 0) answer(ends[1], work, grants, parent);
  close(ends[1]);
  const std::string said = pid > 0 ? read_all(ends[0]) : "";
  close(ends[0]);
  if (pid < 0)
    return std::unexpected(
        Refusal{kExitFailed, fmt::format("no process more: {}; free some processes", std::strerror(errno))});
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (said.empty()) return std::unexpected(why_silent(status));
  if (said.front() == '-') return std::unexpected(Refusal{refused, said.substr(1)});
  return said.substr(1);
}

}  // namespace takt::cli
