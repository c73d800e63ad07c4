// SPDX-License-Identifier: Apache-2.0
// The simulated person at the arm switch, the same for every method: arms the robot once nothing blocks it and, where a
// panel says so, ends a stop or fault and arms again.
//
// What the operator does after a stop, `rearm_after` from the tick that entered it:
//   damped_stop    reset once nothing but the stop blocks arming: until then the robot holds itself, disabled it would
//                  fall
//   fault_latched  reset; the executive grants it when the fault is gone
//   standby        reset where a joint reads elsewhere than before its drive fell silent: the person looked; arm once
//                  nothing blocks it
// Knows what a person could see: the newest record. Thread rule: one thread at a time.
#pragma once

#include <optional>

#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::evidence {

class Operator {
 public:
  // Empty: a stop is not ended.
  explicit Operator(std::optional<Duration> rearm_after) : rearm_after_(rearm_after) {}

  // The request for the tick that follows `latest`. Call once per tick, in order.
  OperatorRequest next(const TickRecord& latest, const pipeline::TickConfig& config);

 private:
  [[nodiscard]] bool may_end_stop(MonoTime now) const;

  std::optional<Duration> rearm_after_;
  MonoTime stopped_at_;  // unset: no stop since the robot was last armed
};

}  // namespace takt::evidence
