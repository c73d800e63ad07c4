// SPDX-License-Identifier: Apache-2.0
// Looks after the folder of the runs once a minute, on a thread of its own: deletes what record.keep does not keep, and
// knows for how many hours there is room. Recording waits for nothing here.
// Thread rule: construct, ask and destroy on one thread.
#pragma once

#include <atomic>
#include <limits>
#include <set>
#include <string>
#include <thread>

#include "config/robot_config.hpp"

namespace takt::monitor {

class RunKeeper {
 public:
  // `robot` outlives this.
  explicit RunKeeper(const config::RobotConfig& robot);
  // See run_shelf.hpp. Not a number: not known yet.
  [[nodiscard]] double hours_left() const { return hours_left_; }

 private:
  void look(const config::RobotConfig& robot);
  std::atomic<double> hours_left_ = std::numeric_limits<double>::quiet_NaN();
  std::set<std::string> failed_;  // the thread's: each is told once
  std::jthread thread_;           // last: ends first
};

}  // namespace takt::monitor
