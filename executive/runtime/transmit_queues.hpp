// SPDX-License-Identifier: Apache-2.0
// Empties the transmit queue of an interface whose bus stands still, before what waits there is too old to leave.
// Thread rule: service thread. Logs; a purge takes the kernel's network lock.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "executive/runtime/queue_watch.hpp"

namespace takt::runtime {

class TransmitQueues {
 public:
  // `interfaces` in the order of the robot's buses.
  TransmitQueues(Duration max_age, std::vector<std::string> interfaces)
      : watch_(max_age), interfaces_(std::move(interfaces)) {}

  [[nodiscard]] QueueWatch& watch() { return watch_; }
  void serve(MonoTime now);

 private:
  QueueWatch watch_;
  std::vector<std::string> interfaces_;
};

}  // namespace takt::runtime
