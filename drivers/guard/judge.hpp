// Whether a demand keeps the contract. Pure; `last` is updated by what may leave.
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
                  LastTorque& last) noexcept;

}  // namespace takt::drivers::guard
