// SPDX-License-Identifier: Apache-2.0
// A command of the user's, kept as a process of ours: with all its children it ends when it is told to, and when we do.
//
// Thread rule: one thread at a time. A copy of this object in a forked child knows of no process.
#pragma once

#include <sys/types.h>

#include <expected>
#include <functional>
#include <optional>
#include <string>

namespace takt::simulation {

class KeptProcess {
 public:
  KeptProcess() = default;
  KeptProcess(const KeptProcess&) = delete;
  KeptProcess& operator=(const KeptProcess&) = delete;
  ~KeptProcess() { end(); }

  // `command`: for /bin/sh; its output goes to stderr. `before`: in the process that becomes the shell. Precondition:
  // not is_kept(). The error is one sentence's end.
  std::expected<void, std::string> start(const std::string& command, const std::function<void()>& before = {});
  // False before start(), after end(), and once ended() said how it ended.
  [[nodiscard]] bool is_kept() const;
  // The exit code, 128 and the signal's number where it died of one; empty: it runs. Precondition: is_kept().
  std::optional<int> ended();
  // The whole group, at once. Does nothing where there is none.
  void end();

 private:
  pid_t process_ = 0, owner_ = 0;
};

}  // namespace takt::simulation
