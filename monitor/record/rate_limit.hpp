// SPDX-License-Identifier: Apache-2.0
// Something that is to happen at a rate, by the caller's clock. Keeps the pace, and skips what was missed. Pure.
#pragma once

#include "executive/contract/mono_time.hpp"

namespace takt::monitor {

class RateLimit {
 public:
  explicit RateLimit(Duration period) : period_(period) {}
  // True at the first `now` and when a period has passed since.
  bool is_due(MonoTime now) {
    if (now < next_) return false;
    next_ = now < next_ + period_ ? next_ + period_ : now + period_;
    return true;
  }

 private:
  Duration period_;
  MonoTime next_;
};

}  // namespace takt::monitor
