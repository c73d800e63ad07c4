// What is wrong is said once, until something else is; and a line a second at most, for what is wrong may change with
// every message of a stranger. Thread rule: one thread.
#pragma once

#include <spdlog/spdlog.h>

#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

class Complaint {
 public:
  void say(MonoTime now, const std::string& sentence) {
    if (sentence == said_ || now < quiet_until_) return;
    said_ = sentence;
    quiet_until_ = now + seconds(1);
    spdlog::warn("{}", sentence);
  }
  void forget() { said_.clear(); }

 private:
  std::string said_;
  MonoTime quiet_until_;
};

}  // namespace takt::sensors
