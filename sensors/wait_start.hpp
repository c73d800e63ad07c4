// SPDX-License-Identifier: Apache-2.0
// When what is taken now may have come at the earliest. Pure.
//
// A process that did not run for a while finds what came meanwhile and cannot tell it from what comes now. What it
// knows is when it began to wait: all that had come by then was taken. So a sample is no younger than the start of the
// wait in which it is taken. After a wait that lasted far longer than it should (the process was stopped, or the
// machine stood still) that start counts for kDelivery more: threads and buffers on the way deliver what they kept.
// Thread rule: one thread at a time.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

// When something was received: at `at`, and not before `since`.
struct Heard {
  MonoTime at, since;
  // A stamp of the instant itself, such as the kernel's.
  constexpr Heard(MonoTime stamped) : at(stamped), since(stamped) {}  // NOLINT(google-explicit-constructor)
  constexpr Heard(MonoTime taken, MonoTime waited_since) : at(taken), since(std::min(taken, waited_since)) {}
};

class WaitStart {
 public:
  static constexpr Duration kDelivery = milliseconds(100);
  static constexpr Duration kWork = milliseconds(20);  // what lies between two waits, generously

  // `longest`: how long a wait is asked to last.
  explicit WaitStart(Duration longest) : longest_(longest) {}

  // Nothing more is there to be taken: a wait begins.
  constexpr void begin(MonoTime now) {
    if (begun_.is_set() && now - begun_ > longest_ + kWork) {
      stalls_[next_] = {begun_, now + kDelivery};
      next_ = (next_ + 1) % stalls_.size();
    }
    begun_ = now;
  }
  // Of what is taken now. Unset: no wait began.
  [[nodiscard]] constexpr MonoTime since(MonoTime now) const {
    MonoTime since = begun_;
    for (const Stall& stall : stalls_)
      if (now <= stall.counts_until) since = std::min(since, stall.began);
    return since;
  }
  [[nodiscard]] constexpr Heard taken(MonoTime now) const { return {now, since(now)}; }

 private:
  struct Stall {
    MonoTime began, counts_until;
  };
  Duration longest_;
  MonoTime begun_;
  std::array<Stall, 8> stalls_{};  // more do not fit into kDelivery
  std::size_t next_ = 0;
};

}  // namespace takt::sensors
