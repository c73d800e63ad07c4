// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/wakeup.hpp"

namespace takt::runtime {
namespace {

// Tells the core that this is a polling loop: leaves its resources to the sibling thread, and leaves the loop faster.
void relax() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

}  // namespace

Wakeup::Wakeup(Clock& clock, config::WakeMode mode, Duration spin) noexcept
    : clock_(&clock), spin_(mode == config::WakeMode::hybrid ? spin : Duration{}) {}

MonoTime Wakeup::wait_until(MonoTime when) noexcept {
  clock_->sleep_until(when - spin_);
  MonoTime now = clock_->now();
  // Bounded by the clock itself: it ends once `when` has come.
  while (now < when) {
    relax();
    now = clock_->now();
  }
  return now;
}

}  // namespace takt::runtime
