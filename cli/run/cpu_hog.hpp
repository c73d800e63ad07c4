// SPDX-License-Identifier: Apache-2.0
// Processes that do nothing but occupy processors for a while: contention by script, for `takt run --at`. Each ends by
// itself after its time, dies with its parent, and is reaped here. Thread rule: one thread.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <expected>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::cli {

struct HogLoad {
  std::vector<int> cpus;    // each gets `per_cpu` processes pinned to it
  std::size_t per_cpu = 1;  //
  int fifo_priority = 0;    // SCHED_FIFO, 1 to 99; 0: ordinary scheduling at `nice`
  int nice = 0;
  Duration length;
};
// Above every priority of the loop nothing else on that core runs, so the time is bounded. Ordinary hogs may take
// longer.
inline constexpr Duration kLongestFifoHog = seconds(1);
// At priority 1 everything real-time goes first, and the kernel takes some time of every second for ordinary ones.
inline constexpr Duration kLongestLowestFifoHog = seconds(60);

class CpuHogs {
 public:
  CpuHogs() = default;
  CpuHogs(const CpuHogs&) = delete;
  CpuHogs& operator=(const CpuHogs&) = delete;
  ~CpuHogs();
  // All of them or none. The error is one sentence: what was not permitted.
  std::expected<void, std::string> start(const HogLoad& load);
  void reap();  // those that ended

 private:
  std::vector<pid_t> running_;
};

// Those this process may run on.
std::vector<int> usable_cpus();

}  // namespace takt::cli
