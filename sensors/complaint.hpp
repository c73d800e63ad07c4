// What is wrong is said once, until something else is.
#pragma once

#include <spdlog/spdlog.h>

#include <string>

namespace takt::sensors {

class Complaint {
 public:
  void say(const std::string& sentence) {
    if (sentence != said_) spdlog::warn("{}", sentence);
    said_ = sentence;
  }
  void forget() { said_.clear(); }

 private:
  std::string said_;
};

}  // namespace takt::sensors
