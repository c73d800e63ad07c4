// SPDX-License-Identifier: Apache-2.0
// Processes that ask for arming until it is granted, as `takt run --arm` and `takt deploy --arm` do. A stop ends their
// asking, so that a press in standby is not followed by a motion. Thread rule: one thread.
#pragma once

#include <sys/types.h>

#include <algorithm>
#include <array>

#include "executive/contract/mono_time.hpp"

namespace takt::runtime {

class PendingArms {
 public:
  // A process that was not heard for this long asks anew.
  static constexpr Duration kForgottenAfter = seconds(2);

  // Whether a stop came since this process began to ask.
  bool is_ended(pid_t pid, MonoTime now) {
    Asker& asker = asker_of(pid, now);
    asker.asked_at = now;
    return asker.ended;
  }
  // A stop was asked for, by any process.
  void stop() {
    for (Asker& asker : askers_) asker.ended = true;
  }
  // It was granted, or this process reset the stop itself.
  void forget(pid_t pid) {
    for (Asker& asker : askers_)
      if (asker.pid == pid) asker = {};
  }

 private:
  struct Asker {
    pid_t pid = 0;
    MonoTime asked_at;
    bool ended = false;
  };
  // Its own place, anew if it was not heard for long; else that of the one that was not heard for longest.
  Asker& asker_of(pid_t pid, MonoTime now) {
    const auto own = std::ranges::find(askers_, pid, &Asker::pid);
    Asker& asker = own != askers_.end() ? *own : *std::ranges::min_element(askers_, {}, &Asker::asked_at);
    if (asker.pid != pid || now > asker.asked_at + kForgottenAfter) asker = {.pid = pid, .asked_at = now};
    return asker;
  }
  std::array<Asker, 16> askers_{};
};

}  // namespace takt::runtime
