// SPDX-License-Identifier: Apache-2.0
// What a frame asks of one drive, protocol by protocol, read from its bytes alone. Pure; any frame may come.
#pragma once

#include "drivers/bus/can_bus.hpp"
#include "drivers/guard/joint_facts.hpp"

namespace takt::drivers::guard {

// Anything that this host never says to this joint's drive: Demand::Kind::unknown.
Demand read_mit(const JointFacts& facts, const CanFrame& frame) noexcept;
Demand read_robstride(const JointFacts& facts, const CanFrame& frame) noexcept;
Demand read_odrive(const JointFacts& facts, const CanFrame& frame) noexcept;
Demand read_moteus(const JointFacts& facts, const CanFrame& frame) noexcept;
Demand read_cia402(const JointFacts& facts, const CanFrame& frame) noexcept;

inline Demand of_kind(Demand::Kind kind) noexcept {
  return {.kind = kind};
}

}  // namespace takt::drivers::guard
