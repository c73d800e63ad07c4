// SPDX-License-Identifier: Apache-2.0
// Commands made wrong on purpose: a NaN, a target far off, outputs that go to the wrong joints. For simulated rollouts
// and for a policy host that was asked to misbehave. Pure. No allocation.
#pragma once

#include <cstddef>

#include "executive/contract/command_chunk.hpp"

namespace takt::policy_host {

struct BadActions {
  double nan_share = 0;         // of commands that hold a NaN, 0..1
  double range_share = 0;       // of commands that ask one joint for 10 rad more, 0..1
  std::size_t joint_shift = 0;  // positions go to joints this many places further on
};

// What the caller drew for this command.
struct Luck {
  std::size_t joint = 0, step = 0;  // which value goes wrong
  double share = 0;                 // [0, 1): wrong when below the share
};

void spoil(CommandChunk& chunk, const BadActions& bad, const Luck& luck);

}  // namespace takt::policy_host
