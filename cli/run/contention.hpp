// SPDX-License-Identifier: Apache-2.0
// What a scenario sets against the robot's processes: hogs, throttling, crowds and the user's own loads. All of it ends
// by itself or with this object. Thread rule: one thread.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/run/child_process.hpp"
#include "cli/run/cpu_hog.hpp"
#include "cli/run/scenario.hpp"
#include "config/robot_config.hpp"

namespace takt::cli {

class Contention {
 public:
  // `robot` outlives it. `load_log`: where loads write.
  Contention(const config::RobotConfig& robot, std::string load_log) : robot_(robot), load_log_(std::move(load_log)) {}
  // Of a hog, throttle, crowd, load or unload event. The error: it is not permitted or not there; a load that is to
  // end had ended by itself, so that it loaded nothing for the time it was meant to.
  std::expected<void, Refusal> apply(const Event& event);
  void reap() { hogs_.reap(); }

 private:
  struct Load {
    std::vector<std::string> command;
    ChildProcess process;
  };
  [[nodiscard]] std::expected<void, Refusal> hog(const Event& event);
  [[nodiscard]] std::expected<void, Refusal> throttle(const Event& event);
  [[nodiscard]] std::expected<void, Refusal> crowd(const Event& event);
  [[nodiscard]] std::expected<void, Refusal> load(const Event& event);
  [[nodiscard]] std::expected<void, Refusal> unload(const Event& event);
  [[nodiscard]] std::expected<void, Refusal> occupy(const HogLoad& load);
  // The control thread's core, or every one if it has none of its own.
  [[nodiscard]] std::vector<int> control_cpus() const;

  const config::RobotConfig& robot_;
  std::string load_log_;
  CpuHogs hogs_;
  std::vector<Load> loads_;
};

}  // namespace takt::cli
