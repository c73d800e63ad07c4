// SPDX-License-Identifier: Apache-2.0
// takt-executive as a child process: its exit code, its standard error, and, if asked for, without real-time rights.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace takt::runtime::test {

enum class Rights { as_we_have, none };  // none: no capabilities, no RLIMIT_RTPRIO, 64 KiB of locked memory

class ExecutiveProcess {
 public:
  explicit ExecutiveProcess(const std::vector<std::string>& arguments, Rights rights = Rights::as_we_have);
  ExecutiveProcess(ExecutiveProcess&& other) noexcept;
  ExecutiveProcess& operator=(ExecutiveProcess&&) = delete;
  ~ExecutiveProcess();  // kills what still runs

  [[nodiscard]] pid_t pid() const { return pid_; }
  void signal(int number) const;
  bool has_ended();
  // Exit code, or 128 + signal, or -1 when it still ran after 20 s.
  int wait();
  // Everything it wrote to standard error; after it ended.
  std::string errors();

 private:
  pid_t pid_ = -1;
  int errors_ = -1;  // read end
  int exit_code_ = -1;
  std::string text_;
};

}  // namespace takt::runtime::test
