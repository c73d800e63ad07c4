// SPDX-License-Identifier: Apache-2.0
// One program that `takt run` started and answers for: it dies with its parent, runs in a process group of its own (so
// that Ctrl-C reaches the supervisor only), writes its output to a log file, and is killed and reaped at the latest
// when this object goes. Thread rule: one thread, the one that started it (PR_SET_PDEATHSIG is tied to it).
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/descriptor.hpp"
#include "policy_host/boundary.hpp"

namespace takt::cli {

// Where a policy runs, and what it becomes and starts: off the executive's processor, for good, or not at all
// (policy_host/processor_fence.hpp), its libraries' thread pools as large as policy.engine.threads unless the
// environment says otherwise, and behind its boundary (policy_host/boundary.hpp).
struct PolicyPlace {
  std::optional<int> off_cpu;  // control.cpu
  unsigned threads = 1;
  policy_host::Grants grants = {};
};
PolicyPlace place_of_policy(const config::RobotConfig& robot, policy_host::Grants grants);

class ChildProcess {
 public:
  struct Options {
    std::string name;                    // for messages: "policy host"
    std::vector<std::string> arguments;  // [0]: path of the program
    std::string log_path;                // appended to
    int parent_death_signal = 0;         // what it gets when the supervisor dies
    std::optional<PolicyPlace> place{};  // of a program that is a policy
    bool with_its_group = false;         // what it started, as a shell script does, ends with it
  };
  // A policy's log keeps this much; what it says beyond is dropped, and counted in the log's last line.
  static constexpr std::uintmax_t kLogBudget_bytes = 8U << 20U;
  static std::expected<ChildProcess, std::string> start(Options options);

  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ~ChildProcess();

  // Reaps it if it died; true while it lives. Cuts a policy's log.
  bool alive();
  // SIGTERM (and SIGCONT, in case it is frozen); SIGKILL after `limit`. Reaps it. Of a program with its group: all of
  // the group, also when the program itself has ended.
  void end(std::chrono::milliseconds limit);
  void signal(int number) const;  // no effect once it died
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] const Options& options() const { return options_; }
  // "exited with 70", "killed by SIGKILL"; empty while it lives.
  [[nodiscard]] std::string how_it_ended() const;
  // "SIGKILL"; empty while it lives, and if it exited.
  [[nodiscard]] std::string ended_by() const;
  // Exit status, 128 + signal number, or nothing while it lives.
  [[nodiscard]] std::optional<int> exit_code() const;
  // Of a policy: what this machine's kernel does not keep it from, a sentence each.
  [[nodiscard]] const std::vector<std::string>& gaps() const { return gaps_; }
  // Last lines of its log, indented, for messages.
  [[nodiscard]] std::string last_words() const;
  // Its log as a file that can be opened, also when another program removed its name.
  [[nodiscard]] std::string log_file() const;

 private:
  ChildProcess(Options options, pid_t pid) : options_(std::move(options)), pid_(pid) {}
  bool reap(int flags);
  // The program, or some process of its group where that counts, is still there.
  bool is_there();
  void tell(int number) const;  // likewise
  void cut_log();
  Options options_;
  ipc::Descriptor log_;
  pid_t pid_ = -1;
  std::vector<std::string> gaps_;
  std::uintmax_t dropped_bytes_ = 0;
  std::optional<int> wait_status_;
};

}  // namespace takt::cli
