// SPDX-License-Identifier: Apache-2.0
// Measures how late a thread like the control thread wakes up: absolute sleeps of one period, SCHED_FIFO and locked
// memory where they are granted, pinned to the core, sleep states forbidden by /dev/cpu_dma_latency where it can be
// opened. In the way of cyclictest (rt-tests), which this does not replace. Counts SMIs and stolen time meanwhile.
// Blocks for `length`; the thread it makes, the lock and the hold on sleep states are gone afterwards.
#pragma once

#include <optional>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "systemd/doctor/snapshot.hpp"

namespace takt::doctor {

struct ProbePlan {
  Duration length;
  Duration period;
  int priority = 0;        // 1..99
  std::optional<int> cpu;  // absent: wherever it runs
  // Folder on the disk that runs are recorded on: the doctor loads memory, disk and the other cores meanwhile
  // (OwnLoad). Absent: it does not.
  std::optional<std::string> load_in;
};

// `root`: before /dev and /proc: empty, but for tests.
WakeupLatency measure_wakeups(const ProbePlan& plan, const std::string& root = {});

// p99.999 of fewer samples rests on less than ten of them, and is not told.
inline constexpr std::uint64_t kFewestForP99999 = 1'000'000;

// Of lateness in ns, at least one: quantiles as the smallest value that is not exceeded by that share.
WakeupLatency summarise(std::vector<std::int64_t> lateness_ns, bool real_time);

}  // namespace takt::doctor
