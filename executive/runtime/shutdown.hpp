// SPDX-License-Identifier: Apache-2.0
// From the first SIGTERM to the end of the loop: damped stop, until the robot rests, then the drives are disabled.
//
// The loop may end when the executive is in standby, or has stopped or faulted and the robot rests, or still moves
// kLongestStop after the first signal; when no tick takes notice of it within kNoticedWithin; at the second signal.
// Pure value: time and state are passed in.
#pragma once

#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::runtime {

inline constexpr Duration kLongestStop = seconds(10);
inline constexpr Duration kNoticedWithin = seconds(1);  // the control thread hangs: nothing brakes any more

class Shutdown {
 public:
  void signal(MonoTime now) noexcept {
    hurry_ = began_.is_set();
    if (!began_.is_set()) began_ = now;
  }
  [[nodiscard]] bool is_requested() const noexcept { return began_.is_set(); }
  // `noticed`: a tick that read the request is over; `mode` and `rests` are of that tick or later.
  [[nodiscard]] bool may_end(MonoTime now, bool noticed, Mode mode, bool rests) const noexcept {
    if (!is_requested()) return false;
    if (hurry_ || now - began_ >= (noticed ? kLongestStop : kNoticedWithin)) return true;
    return noticed && (mode == Mode::standby || (rests && (mode == Mode::damped_stop || mode == Mode::fault_latched)));
  }

 private:
  MonoTime began_;
  bool hurry_ = false;
};

}  // namespace takt::runtime
