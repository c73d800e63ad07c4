// SPDX-License-Identifier: Apache-2.0
// Bytes within a rate: a second's worth at first, and never more saved up. What is taken may exceed what is left; the
// next then waits for it. Pure: the time is the caller's.
#pragma once

#include <algorithm>
#include <cstddef>

#include "executive/contract/mono_time.hpp"

namespace takt::monitor {

class ByteAllowance {
 public:
  explicit ByteAllowance(double bytes_per_s) : rate_(bytes_per_s), left_(bytes_per_s) {}
  // Whether any is left. `now`: never backwards.
  bool has_any(MonoTime now) {
    if (asked_at_.is_set()) left_ = std::min(rate_, left_ + rate_ * (now - asked_at_).seconds());
    asked_at_ = now;
    return left_ > 0;
  }
  void take(std::size_t bytes) { left_ -= static_cast<double>(bytes); }

 private:
  double rate_, left_;
  MonoTime asked_at_;
};

}  // namespace takt::monitor
