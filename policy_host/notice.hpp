// SPDX-License-Identifier: Apache-2.0
// A condition that may last: said when it begins or changes, and again every ten seconds, not at every retry; and a
// line a second at most, for it may change with every message of a stranger, and come and go. Thread rule: one thread,
// never the control thread.
#pragma once

#include <spdlog/spdlog.h>

#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::policy_host {

class Notice {
 public:
  void say(MonoTime now, const std::string& sentence) {
    if (said_at_.is_set() && now - said_at_ < (sentence == said_ ? seconds(10) : seconds(1))) return;
    said_ = sentence;
    said_at_ = now;
    spdlog::warn("{}", sentence);
  }
  // The condition is over: the next one is news again.
  void clear() { said_.clear(); }

 private:
  std::string said_;
  MonoTime said_at_;
};

}  // namespace takt::policy_host
