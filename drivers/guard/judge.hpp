// SPDX-License-Identifier: Apache-2.0
// Whether a demand keeps the contract. Pure; `last` is updated by what may leave.
//
// No torque is excused for braking: one that brakes by a wrong estimate pushes.
#pragma once

#include "drivers/guard/joint_facts.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/contract/wire_verdict.hpp"

namespace takt::drivers::guard {

struct Moment {
  MonoTime decided_at, now, valid_until;  // unset valid_until: no command is in use
  bool enabled = false;
  bool heard = false;  // the newest feedback was young enough when the tick decided
};

WireVerdict judge(const JointFacts& facts, const Demand& demand, const Moment& moment, const JointRecord& record,
                  LastTold& last) noexcept;

// As far from the last torque as one period allows. After frames that asked for nothing, from theirs or from none.
struct Range {
  float low = 0, high = 0;
};
Range torques_within_slew(const JointFacts& facts, const LastTold& last) noexcept;

}  // namespace takt::drivers::guard
