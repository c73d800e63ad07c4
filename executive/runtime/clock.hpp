// SPDX-License-Identifier: Apache-2.0
// The control thread's clock: the only place of the executive where the tick's time is read or waited for.
//
// A port, so that a test can drive the loop through virtual time. Thread rule: control thread.
#pragma once

#include "executive/contract/mono_time.hpp"
#include "executive/runtime/suspend_watch.hpp"

namespace takt::runtime {

class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;
  virtual MonoTime now() noexcept = 0;
  // Returns at `when` or later; at once when it has passed.
  virtual void sleep_until(MonoTime when) noexcept = 0;
  // For noticing that the computer was suspended: now() stands still meanwhile, this does not.
  virtual Duration since_boot() noexcept = 0;

  BootReading read_boot_time() noexcept {
    const MonoTime before = now();
    const Duration boot = since_boot();
    return {before, boot, now()};
  }
};

// CLOCK_MONOTONIC: read through the vDSO (19 ns), waited for with an absolute clock_nanosleep.
class SystemClock final : public Clock {
 public:
  MonoTime now() noexcept override;
  void sleep_until(MonoTime when) noexcept override;
  Duration since_boot() noexcept override;
};

}  // namespace takt::runtime
