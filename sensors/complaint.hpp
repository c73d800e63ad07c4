// SPDX-License-Identifier: Apache-2.0
// What is wrong is said once, until something else is; and after five lines in a row one a second at most, for what is
// wrong may change with every message of a stranger. Thread rule: one thread.
#pragma once

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

class Complaint {
 public:
  void say(MonoTime now, const std::string& sentence) {
    paid_until_ = std::max(paid_until_, now);
    if (sentence == said_ || paid_until_ - now > kLine * (kAtOnce - 1)) return;
    said_ = sentence;
    paid_until_ = paid_until_ + kLine;
    spdlog::warn("{}", sentence);
  }
  void forget() { said_.clear(); }

 private:
  std::string said_;
  static constexpr Duration kLine = seconds(1);
  static constexpr std::int64_t kAtOnce = 5;
  MonoTime paid_until_;
};

}  // namespace takt::sensors
