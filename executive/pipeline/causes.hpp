// SPDX-License-Identifier: Apache-2.0
// Which causes hold in this tick, as bits: measured conditions, timers, and the operator's requests where granted.
// Conditions of drives, buses and feedback hold in every mode (in standby they block arming); the others only where
// they can mean something. Reads this tick's record as far as it is filled in (inputs, estimates, freshness).
#pragma once

#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

// Operator requests aside.
CauseMask conditions(const TickState& state, const TickRecord& record, const TickConfig& config);

// The joints that a reaction with scope `joint` is about: silent, implausible, faulty, disabled by themselves, on a bus
// that is off or down; while arming also those that are not enabled yet. Holds in every mode; means something where a
// fault latches.
JointMask affected_joints(const TickState& state, const TickRecord& record, const TickConfig& config);

// A second press within this time is a hand that trembles, or the same press told twice.
inline constexpr Duration kStopAgainAfter = milliseconds(200);

// The cause of the operator's request if it is granted, else 0. Arming: from standby with no blocker. Reset: it turns
// the drives off, so only while the robot rests; from a latched fault only while none of its lasting conditions is
// among `active`. De-energising: always; so does a press of stop while another press is in force.
CauseMask granted_request(const TickState& state, const TickRecord& record, CauseMask active, const TickConfig& config);

}  // namespace takt::pipeline
