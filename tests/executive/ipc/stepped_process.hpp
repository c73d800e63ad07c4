// SPDX-License-Identifier: Apache-2.0
// A forked child that runs one function again and again and can be stopped between any two machine instructions
// (ptrace), so that a test can interleave with compiled code at every point instead of hoping for an unlucky schedule.
#pragma once

#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace takt::ipc {

class SteppedProcess {
 public:
  // The child runs `round` once per round; it inherits everything of ours as it is now.
  template <class Round>
  explicit SteppedProcess(Round round) : child_(fork()) {
    if (child_ == 0) {
      if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) _exit(1);
      for (;;) {
        raise(SIGSTOP);  // between rounds
        round();
      }
    }
    is_traced_ = waits_for_stop() == SIGSTOP;
    if (is_traced_) ptrace(PTRACE_SETOPTIONS, child_, nullptr, PTRACE_O_EXITKILL);
  }
  SteppedProcess(const SteppedProcess&) = delete;
  SteppedProcess& operator=(const SteppedProcess&) = delete;
  ~SteppedProcess() {
    if (child_ <= 0 || has_ended_) return;
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
  }

  // False where tracing is forbidden (some containers): nothing else may be called then.
  [[nodiscard]] bool is_traced() const { return is_traced_; }

  // Executes one instruction of the round. False: the round is over.
  bool step() {
    ptrace(PTRACE_SINGLESTEP, child_, nullptr, nullptr);
    return waits_for_stop() == SIGTRAP;
  }
  // Executes at most `count` instructions; false when the round ended before.
  bool step(int count) {
    for (int i = 0; i < count; ++i) {
      if (!step()) return false;
    }
    return true;
  }
  void finish_round() {
    ptrace(PTRACE_CONT, child_, nullptr, nullptr);
    waits_for_stop();
  }
  int instructions_per_round() {
    int count = 1;
    while (step()) ++count;
    return count;
  }

 private:
  int waits_for_stop() {
    int status = 0;
    has_ended_ = waitpid(child_, &status, 0) != child_ || !WIFSTOPPED(status);
    return has_ended_ ? 0 : WSTOPSIG(status);
  }
  pid_t child_;
  bool is_traced_ = false;
  bool has_ended_ = false;
};

}  // namespace takt::ipc
