// SPDX-License-Identifier: Apache-2.0
// How many steps are due, and when to look again: wall time into steps, tolerant of a host that stalls.
//
// A short stall is caught up with, step by step; of a long one only the last kMaxCatchUp steps are run, the rest is
// skipped and counted, and the simulated time falls behind for good. The phase of the wake-ups drifts (at most
// kMaxNudge per turn) to kLead after the commands' arrival, so that a tick's commands are answered within that tick
// however the two processes were started. Pure: time is passed in.
#pragma once

#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt::simulation {

class Pacer {
 public:
  static constexpr int kMaxCatchUp = 50;
  static constexpr Duration kMaxNudge = microseconds(20);
  static constexpr Duration kLead = microseconds(250);

  // Precondition: step > 0.
  Pacer(Duration step, MonoTime first) : step_(step), next_(first) {}
  // Steps to run now; 0 when woken early.
  int steps_due(MonoTime now);
  void follow(MonoTime command_arrived_at);
  [[nodiscard]] MonoTime next_wake() const { return next_; }
  [[nodiscard]] std::uint64_t skipped() const { return skipped_; }

 private:
  Duration step_;
  MonoTime next_;
  std::uint64_t skipped_ = 0;
};

}  // namespace takt::simulation
