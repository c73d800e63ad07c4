// SPDX-License-Identifier: Apache-2.0
// What the simulated robot really did, as JSON lines, so that tracking can be judged without asking the executive:
//   {"monotonic_ns":..,"q":[rad],"dq":[rad/s],"tool":[m],"target":[m],"error_m":..}
// tool: what the task wants at its target; a cart, where there is one.
// Thread rule: one thread at a time.
#pragma once

#include <cstdio>
#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "simulation/arm_dynamics.hpp"

namespace takt::simulation {

struct Truth {
  MonoTime at;
  const ArmState& arm;
  config::Vector3 tool, target;
};
double tool_error(const Truth& truth);  // m

class TruthLog {
 public:
  // Replaces the file. The error is one sentence.
  static std::expected<TruthLog, std::string> create(const std::string& path);
  void write(const Truth& truth);
  void flush();

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  explicit TruthLog(std::FILE* file) : file_(file) {}
  std::unique_ptr<std::FILE, Close> file_;
  std::string line_;
};

}  // namespace takt::simulation
