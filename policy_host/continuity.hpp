// SPDX-License-Identifier: Apache-2.0
// Does an observation go on where the last one answered ended? Where not, what a policy remembers is worthless.
//
// It does not at the start of a session, when ids run backwards, when more than kMaxGap observations more were missed
// than before the last answer, and when the robot starts arming. A policy whose answers take many periods misses about
// as many before each, and remembers from answer to answer. A short gap only counts as dropped observations. Pure.
// Thread rule: one thread.
#pragma once

#include <cstdint>

#include "executive/contract/mode.hpp"
#include "executive/contract/observation.hpp"

namespace takt::policy_host {

class Continuity {
 public:
  static constexpr std::uint64_t kMaxGap = 5;  // observations missed beyond what is usual before history is worthless
  struct Step {
    bool continues;
    std::uint64_t dropped;  // since the last one
  };

  void start_session() { last_id_ = last_dropped_ = 0; }
  Step advance(const Observation& observation) {
    const auto mode = static_cast<Mode>(observation.mode);
    const bool starts_arming = mode == Mode::arming && last_mode_ != Mode::arming;
    const bool forwards = observation.id > last_id_;
    const std::uint64_t dropped = last_id_ != 0 && forwards ? observation.id - last_id_ - 1 : 0;
    const bool skips = last_id_ == 0 ? observation.id > 1 + kMaxGap : dropped > last_dropped_ + kMaxGap;
    const Step step{forwards && !skips && !starts_arming, dropped};
    last_id_ = observation.id;
    last_dropped_ = dropped;
    last_mode_ = mode;
    return step;
  }

 private:
  std::uint64_t last_id_ = 0;       // 0: none in this session
  std::uint64_t last_dropped_ = 0;  // before it
  Mode last_mode_ = Mode::standby;
};

}  // namespace takt::policy_host
