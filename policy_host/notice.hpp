// A condition that may last: said when it begins or changes, and again every ten seconds, not at every retry.
// Thread rule: one thread, never the control thread.
#pragma once

#include <spdlog/spdlog.h>

#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::policy_host {

class Notice {
 public:
  void say(MonoTime now, const std::string& sentence) {
    if (sentence == said_ && now < again_) return;
    said_ = sentence;
    again_ = now + seconds(10);
    spdlog::warn("{}", sentence);
  }
  // The condition is over: the next one is news again.
  void clear() { said_.clear(); }

 private:
  std::string said_;
  MonoTime again_;
};

}  // namespace takt::policy_host
