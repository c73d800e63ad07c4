// SPDX-License-Identifier: Apache-2.0
// A bridge between policy and executive that repeats the last command for ever: what robots do whose driver keeps the
// newest setpoint. Method `blind` puts it in; with the age limit lifted as well, nothing notices a silent policy.
//
// Commands pass through as they are. When no new one came and the last one ends soon, each observation is answered with
// its continuation: the same path at the same instants, and its last step from the end on. The age stays true: it says
// when the data behind the original command were sensed. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <memory>

#include "evidence/rollout/virtual_policy.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"

namespace takt::evidence {

class RepeatLast {
 public:
  // `held`: steps mean hold (policy.action.interpolation).
  explicit RepeatLast(bool held) : held_(held) {}
  // Renumbers it in place, since both kinds of command share one sequence. One that is not finite is not kept.
  void pass(const ArrivedCommand& command);
  void observe(const Observation& observation);
  // Null: nothing to say now. Valid until the next call of observe.
  const CommandChunk* read();

 private:
  MonoTime source_observed_at_, source_sensed_at_;
  std::unique_ptr<CommandChunk> source_ = std::make_unique<CommandChunk>(),
                                repeated_ = std::make_unique<CommandChunk>();
  std::uint64_t sequence_ = 0;
  bool held_;
  bool has_source_ = false, due_ = false;
};

}  // namespace takt::evidence
