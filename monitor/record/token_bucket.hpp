// SPDX-License-Identifier: Apache-2.0
// How much of what another process decides may be recorded: so many at once, and one more per period from then on. Full
// at first; the first refill starts its clock, and a clock that runs backwards gives nothing. Pure.
#pragma once

#include <algorithm>
#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt::monitor {

class TokenBucket {
 public:
  // period > 0, most >= 1.
  TokenBucket(Duration period, std::uint32_t most)
      : period_(period), most_(period * static_cast<std::int64_t>(most)), left_(most_) {}
  void refill(MonoTime now) {
    if (filled_at_.is_set() && now > filled_at_) left_ = std::min(left_ + (now - filled_at_), most_);
    filled_at_ = now;
  }
  // True: one may be recorded, and is counted.
  bool take() {
    if (left_ < period_) return false;
    left_ = left_ - period_;
    return true;
  }

 private:
  Duration period_, most_, left_;
  MonoTime filled_at_;
};

}  // namespace takt::monitor
