// SPDX-License-Identifier: Apache-2.0
// Waiting for the next period, in the two ways the robot file offers.
//
//   sleep   absolute clock_nanosleep. Costs nothing while it waits; late by the kernel's wake-up latency (tens of us).
//   hybrid  sleeps until `spin` before the instant, then polls the clock. Late by about 0.1 us, and costs spin / period
//   of
//           one core (100 us of 1 ms: 10 %). When the sleep itself comes back later than that, the rest is late too.
//
// Thread rule: control thread. System calls: clock_nanosleep.
#pragma once

#include "config/robot_config.hpp"
#include "executive/runtime/clock.hpp"

namespace takt::runtime {

class Wakeup {
 public:
  // `spin` is used by hybrid only; 0 <= spin.
  Wakeup(Clock& clock, config::WakeMode mode, Duration spin) noexcept;
  // Returns the instant at which it woke: >= when.
  MonoTime wait_until(MonoTime when) noexcept;
  // How much of each wait is spent spinning, at most.
  [[nodiscard]] Duration spin() const noexcept { return spin_; }

 private:
  Clock* clock_;
  Duration spin_;  // 0 in sleep mode
};

}  // namespace takt::runtime
