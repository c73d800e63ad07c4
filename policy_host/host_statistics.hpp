// SPDX-License-Identifier: Apache-2.0
// What the policy host says about itself every ten seconds: commands per second, inference time, observations dropped.
// Pure; room for a window's samples is kept, so that adding allocates nothing once warm. Thread rule: one thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "executive/contract/command_chunk.hpp"

namespace takt::policy_host {

class HostStatistics {
 public:
  void add(const CommandHeader& published);
  void withheld() { ++withheld_; }    // an observation answered with silence: a sensor was missing
  void overtaken() { ++overtaken_; }  // an answer that came after one to a newer observation, and was dropped
  // One line about the commands since the last call, `window` long; then starts over.
  std::string summary(Duration window);

 private:
  std::vector<std::int64_t> infer_ns_;
  std::uint64_t dropped_ = 0;
  std::uint64_t withheld_ = 0;
  std::uint64_t overtaken_ = 0;
};

}  // namespace takt::policy_host
