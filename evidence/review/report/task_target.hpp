// SPDX-License-Identifier: Apache-2.0
// Where the task's target was, from the simulator's truth file (simulation/truth_log.hpp): read line by line, as
// time goes on. Lines that are none are passed over. Units: m, base frame. Errors are one sentence. Thread rule: one
// thread.
#pragma once

#include <expected>
#include <fstream>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::evidence {

class TaskTarget {
 public:
  static std::expected<TaskTarget, std::string> open(const std::string& path);
  // The newest one written at or before `now`, which must not run backwards; nothing before the first.
  std::optional<config::Vector3> at(MonoTime now);

 private:
  struct Entry {
    MonoTime at;
    config::Vector3 target{};
  };
  explicit TaskTarget(std::ifstream stream) : stream_(std::move(stream)) { next_ = read(); }
  std::optional<Entry> read();

  std::ifstream stream_;
  std::optional<Entry> next_, current_;
};

}  // namespace takt::evidence
