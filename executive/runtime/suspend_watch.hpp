// SPDX-License-Identifier: Apache-2.0
// Notices that the computer was suspended: CLOCK_BOOTTIME runs on meanwhile, CLOCK_MONOTONIC, which tells all ages,
// does not. Source: clock_gettime(2).
//
// No clock reads both at once, and a thread may be preempted between two readings. So CLOCK_BOOTTIME is read between
// two readings of CLOCK_MONOTONIC: its lead is then known to lie between two bounds, and the computer slept for
// certain when the lower bound of now is above the upper bound of before. Pure value: readings are passed in.
#pragma once

#include <algorithm>

#include "executive/contract/mono_time.hpp"

namespace takt::runtime {

struct BootReading {
  MonoTime before;      // CLOCK_MONOTONIC, read first
  Duration since_boot;  // CLOCK_BOOTTIME
  MonoTime after;       // CLOCK_MONOTONIC, read last
};

inline constexpr Duration kShortestSleep = milliseconds(1);  // the kernel's own needs more to freeze and thaw

class SuspendWatch {
 public:
  explicit SuspendWatch(const BootReading& first) noexcept : largest_lead_(upper(first)) {}

  // For how long the computer slept since the reading before, rather too short than too long; 0: it did not.
  Duration slept(const BootReading& reading) noexcept {
    const bool has = has_slept(reading.since_boot, reading.after);
    const Duration grown = growth(reading.since_boot, reading.after);
    largest_lead_ = has ? upper(reading) : std::min(largest_lead_, upper(reading));
    return has ? grown : Duration{};
  }
  // Whether it slept since that reading. `now`: CLOCK_MONOTONIC, read after `since_boot`.
  [[nodiscard]] bool has_slept(Duration since_boot, MonoTime now) const noexcept {
    return growth(since_boot, now) >= kShortestSleep;
  }

 private:
  [[nodiscard]] Duration growth(Duration since_boot, MonoTime after) const noexcept {
    return since_boot - (after - MonoTime{}) - largest_lead_;
  }
  static Duration upper(const BootReading& reading) noexcept {
    return reading.since_boot - (reading.before - MonoTime{});
  }
  Duration largest_lead_;  // of CLOCK_BOOTTIME over CLOCK_MONOTONIC
};

}  // namespace takt::runtime
