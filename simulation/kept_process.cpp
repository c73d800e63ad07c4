// SPDX-License-Identifier: Apache-2.0
#include "simulation/kept_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

#include "executive/ipc/descriptor.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::simulation {
namespace {

int code_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

[[noreturn]] void run_shell(const std::string& command, const std::function<void()>& before, const sigset_t& signals) {
  ::setpgid(0, 0);
  ::sigprocmask(SIG_UNBLOCK, &signals, nullptr);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);  // ours has tables and JSON
  if (before) before();
  ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
  ::_exit(127);
}

// 0: there is none.
pid_t first_child() {
  std::array<char, 16> text{};
  const ipc::Descriptor children(::open("/proc/thread-self/children", O_RDONLY | O_CLOEXEC));
  if (::read(children.get(), text.data(), text.size() - 1) <= 0) return 0;
  return static_cast<pid_t>(std::strtol(text.data(), nullptr, 10));
}

// Orphans that have ended are taken along. `status`: the shell's.
bool has_ended(pid_t shell, int& status) {
  int of_one = 0;
  for (pid_t pid = ::waitpid(-1, &of_one, WNOHANG); pid > 0; pid = ::waitpid(-1, &of_one, WNOHANG)) {
    if (pid != shell) continue;
    status = of_one;
    return true;
  }
  return false;
}

// In a child of ours: a shell's children do not die with it, nor it with us. This one does, and takes the group along.
// Ends as the command does, or when it is told to. After a fork: calls that are safe in signal handlers only.
[[noreturn]] void keep(const std::string& command, const std::function<void()>& before, pid_t parent) {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::sigaddset(&signals, SIGCHLD);
  ::sigprocmask(SIG_BLOCK, &signals, nullptr);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);  // the group's orphans are waited for here
  if (::getppid() != parent) ::_exit(1);
  ::setpgid(0, 0);  // Ctrl-C is for the one that we belong to
  const pid_t shell = ::fork();
  if (shell < 0) ::_exit(1);
  if (shell == 0) run_shell(command, before, signals);
  ::setpgid(shell, shell);   // whichever process comes first
  ::close_range(3, ~0U, 0);  // our connections end with us, and not with this copy of them
  int status = 0;
  for (int signal = 0; signal != SIGTERM && !has_ended(shell, status);) signal = ::sigwaitinfo(&signals, nullptr);
  ::kill(-shell, SIGKILL);
  // All of the group is gone when this process is: what it held, the next command may take.
  int of_group = 0;
  while (::waitpid(-shell, &of_group, 0) > 0) {
  }
  // Also who left the group.
  for (pid_t child = first_child(); child > 0 && ::kill(child, SIGKILL) == 0; child = first_child())
    ::waitpid(child, nullptr, 0);
  ::_exit(code_of(status));
}

}  // namespace

bool KeptProcess::is_kept() const {
  return process_ > 0 && owner_ == ::getpid();
}

std::expected<void, std::string> KeptProcess::start(const std::string& command, const std::function<void()>& before) {
  owner_ = ::getpid();
  const pid_t pid = ::fork();
  if (pid < 0) return std::unexpected("no process for it: " + ipc::errno_text());
  if (pid == 0) keep(command, before, owner_);
  process_ = pid;
  return {};
}

std::optional<int> KeptProcess::ended() {
  int status = 0;
  if (::waitpid(process_, &status, WNOHANG) != process_) return std::nullopt;
  process_ = 0;
  return code_of(status);
}

void KeptProcess::end() {
  if (is_kept()) {
    ::kill(process_, SIGTERM);
    ::waitpid(process_, nullptr, 0);
  }
  process_ = 0;
}

}  // namespace takt::simulation
