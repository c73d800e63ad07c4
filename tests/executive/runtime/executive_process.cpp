// SPDX-License-Identifier: Apache-2.0
#include "tests/executive/runtime/executive_process.hpp"

#include <fcntl.h>
#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <thread>
#include <utility>

namespace takt::runtime::test {
namespace {

// After this, exec gives root no capability back, and the limits cannot be raised.
void give_up_rights() {
  const rlimit no_priority{0, 0};
  setrlimit(RLIMIT_RTPRIO, &no_priority);
  const rlimit little_memory{64 << 10, 64 << 10};
  setrlimit(RLIMIT_MEMLOCK, &little_memory);
  for (unsigned long capability = 0; capability <= CAP_LAST_CAP; ++capability) {
    if (capability == CAP_DAC_OVERRIDE) continue;  // the build tree may belong to another user
    prctl(PR_CAPBSET_DROP, capability, 0UL, 0UL, 0UL);
  }
}

}  // namespace

ExecutiveProcess::ExecutiveProcess(const std::vector<std::string>& arguments, Rights rights) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return;
  std::string program = std::string(TAKT_BIN_DIR) + "/takt-executive";
  std::vector<std::string> copies = arguments;
  std::vector<char*> argv{program.data()};
  for (std::string& argument : copies) argv.push_back(argument.data());
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(ends[1], STDERR_FILENO);
    if (rights == Rights::none) give_up_rights();
    execv(program.c_str(), argv.data());
    _exit(127);
  }
  close(ends[1]);
  errors_ = ends[0];
}

ExecutiveProcess::ExecutiveProcess(ExecutiveProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      errors_(std::exchange(other.errors_, -1)),
      exit_code_(other.exit_code_),
      text_(std::move(other.text_)) {}

ExecutiveProcess::~ExecutiveProcess() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  if (errors_ >= 0) close(errors_);
}

void ExecutiveProcess::signal(int number) const {
  if (pid_ > 0) kill(pid_, number);
}

bool ExecutiveProcess::has_ended() {
  if (pid_ <= 0) return true;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return false;
  pid_ = -1;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return true;
}

int ExecutiveProcess::wait() {
  for (int i = 0; i < 2000 && !has_ended(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return exit_code_;
}

std::string ExecutiveProcess::errors() {
  char bytes[4096];
  ssize_t size = 0;
  while (pid_ <= 0 && (size = read(errors_, bytes, sizeof bytes)) > 0)
    text_.append(bytes, static_cast<std::size_t>(size));
  return text_;
}

}  // namespace takt::runtime::test
