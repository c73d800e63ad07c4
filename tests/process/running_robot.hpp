// SPDX-License-Identifier: Apache-2.0
// A whole robot in real processes, for tests: starts programs of this build in a runtime directory of their own, asks
// the executive for its status, and leaves nothing running. Waits are bounded polls for a state, never sleeps to be
// right.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "executive/contract/session.hpp"
#include "tests/process/child.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {

class RunningRobot {
 public:
  // Starts takt-plant, takt-executive and takt-monitor for a patient copy of this robot file; no policy yet.
  // `scenario`: file of what goes wrong in the plant. `changes`: to the robot file. `world`: socket of the process that
  // plays the mechanics; empty: the plant does.
  explicit RunningRobot(const std::string& scenario = {}, const std::string& robot_file = "config/arm6.yaml",
                        const std::vector<config::Override>& changes = {}, const std::string& world = {});
  ~RunningRobot();
  RunningRobot(const RunningRobot&) = delete;
  RunningRobot& operator=(const RunningRobot&) = delete;

  // Another `log_path` than its own file: a pipe, say.
  Child start_executive(const std::string& log_path = {});
  Child start_policy_host();
  Child start_fallback_host();
  Child start_rogue(const std::string& behaviour, const std::string& healthy_for);
  Child start_monitor(const std::string& run_directory_name);

  // Polls the executive until `holds` or 20 s passed; returns the last status.
  std::optional<OperatorReply> wait_until(const std::function<bool(const StatusSnapshot&)>& holds) const;
  bool wait_for_mode(Mode mode) const;
  // Asks until the robot was reset or 20 s passed.
  bool reset() const;
  // Asks until armed or 20 s passed; returns the last refusal, empty when armed.
  std::string arm() const;
  [[nodiscard]] std::optional<OperatorReply> status() const;
  // `takt ARGUMENTS...` to its end, 60 s at most. True: it exited with 0.
  bool takt(std::vector<std::string> arguments) const;
  // Lets that many ticks pass. Returns the number of the last one.
  std::uint64_t let_run(std::uint64_t ticks) const;

  // Ends executive, then monitor (so that the run folder is complete). True when both exited with 0.
  bool finish();

  [[nodiscard]] std::string run_directory() const { return directory_.path("run"); }
  [[nodiscard]] const std::string& directory() const { return directory_.path(); }
  [[nodiscard]] const std::string& robot_file() const { return robot_file_; }
  // Everything the programs logged, for failure messages.
  [[nodiscard]] std::string logs() const;
  Child& executive() { return *executive_; }
  Child& monitor() { return *monitor_; }

 private:
  [[nodiscard]] Child start(const std::string& program, std::vector<std::string> extra,
                            const std::string& log_name) const;
  const TemporaryDirectory directory_;
  std::string robot_file_;
  std::optional<Child> plant_, executive_, monitor_;
};

}  // namespace takt::test
