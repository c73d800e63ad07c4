// SPDX-License-Identifier: Apache-2.0
// What leaves instead of a frame that the guard refused.
#pragma once

#include "drivers/bus/can_bus.hpp"
#include "drivers/guard/joint_facts.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::drivers::guard {

// Takes the drive's power away.
CanFrame disable_frame(const JointFacts& facts) noexcept;

// Brakes with the joint's damping: in the drive where its protocol knows damping, else as a torque.
//
// Such a torque acts against a motion of which two know: the estimate, and the drive's own velocity; it damps the
// slower of them, within the torque limit, and is no further from `last` than the slew allows, or nearer to none. Of a
// joint that is not `heard`, or of which the two say opposite things, it is zero.
// Drives with loops of their own: speed 0; the position they were told last, or where the joint was heard. One that
// knows neither position is switched off.
// `last` becomes what the frame says.
CanFrame damping_frame(const JointFacts& facts, const JointRecord& record, bool heard, LastTold& last) noexcept;

}  // namespace takt::drivers::guard
