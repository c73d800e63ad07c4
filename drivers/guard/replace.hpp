// What leaves instead of a frame that the guard refused.
#pragma once

#include "drivers/bus/can_bus.hpp"
#include "drivers/guard/joint_facts.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::drivers::guard {

// Takes the drive's power away.
CanFrame disable_frame(const JointFacts& facts) noexcept;

// Brakes with the joint's damping: in the drive where its protocol knows damping, else as a torque from the estimate of
// a joint that is `heard`, else as a torque of zero. Drives with loops of their own: speed 0, the measured position.
CanFrame damping_frame(const JointFacts& facts, const JointRecord& record, bool heard) noexcept;

// The torque that damping_frame() makes at the estimate.
float damping_torque(const JointFacts& facts, const JointRecord& record, bool heard) noexcept;

}  // namespace takt::drivers::guard
