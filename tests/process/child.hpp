// SPDX-License-Identifier: Apache-2.0
// A program of this build in a process of its own, for tests.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace takt::test {

// One child process; killed and reaped when it goes out of scope.
class Child {
 public:
  // argv[0] is the name of a program of this build, or another's whole path. Output goes to `log_path`.
  Child(std::vector<std::string> arguments, const std::string& log_path);
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child();
  void signal(int number) const;
  // Exit status as the shell would say it (128 + signal), or nothing if it still ran after `limit`.
  std::optional<int> wait(std::chrono::seconds limit);
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
};

}  // namespace takt::test
