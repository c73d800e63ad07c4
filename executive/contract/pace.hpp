// SPDX-License-Identifier: Apache-2.0
// The grid of instants at which ticks are due: first, first + period, first + 2 periods, ... A tick that ends after the
// next instant skips every instant that has passed; it never shifts the grid, and never runs ticks in a burst to catch
// up. Pure value.
#pragma once

#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt {

class Pace {
 public:
  Pace(MonoTime first, Duration period) noexcept : due_(first), period_(period) {}

  [[nodiscard]] MonoTime due() const noexcept { return due_; }
  // Since the start: instants of the grid at which no tick ran.
  [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }

  // The tick of due() ended at `end`: moves on to the first instant of the grid not before it. Returns how many
  // instants were skipped on the way; 0 when the tick ended in time.
  std::uint64_t advance(MonoTime end) noexcept {
    due_ = due_ + period_;
    if (end <= due_) return 0;
    const std::int64_t missed = ((end - due_).ns + period_.ns - 1) / period_.ns;
    due_ = due_ + period_ * missed;
    skipped_ += static_cast<std::uint64_t>(missed);
    return static_cast<std::uint64_t>(missed);
  }

 private:
  MonoTime due_;
  Duration period_;
  std::uint64_t skipped_ = 0;
};

}  // namespace takt
