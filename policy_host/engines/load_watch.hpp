// SPDX-License-Identifier: Apache-2.0
// While foreign code is loaded: what would end or stall the process without a word ends it with one line and 65.
//
//   LoadWatch watch("/opt/plugin.so", seconds(60));   // a crash, an exit(), a hang from here on is said of this file
//
// Until it goes: SIGSEGV, SIGBUS, SIGILL, SIGFPE and SIGABRT on any thread, an end by exit(), and the time limit
// (wall clock, by SIGALRM). What was there before is there again afterwards. Thread rule: set-up, one at a time.
#pragma once

#include <csignal>
#include <memory>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::policy_host {

class LoadWatch {
 public:
  LoadWatch(const std::string& what, Duration within);
  LoadWatch(const LoadWatch&) = delete;
  LoadWatch& operator=(const LoadWatch&) = delete;
  ~LoadWatch();

 private:
  struct Before {
    int signal;
    struct sigaction action;
  };
  std::vector<Before> before_;
  std::unique_ptr<std::byte[]> stack_;  // a plugin may have used up the thread's own
  stack_t stack_before_{};
};

}  // namespace takt::policy_host
