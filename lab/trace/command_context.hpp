// SPDX-License-Identifier: Apache-2.0
// What else happened while a command was under way. Pure.
#pragma once

#include <vector>

#include "lab/trace/review.hpp"

namespace takt::lab {

// Of one executive. `records` may be null.
CommandContext context_of(const CommandChain& chain, const TracedExecutive& executive, Duration period,
                          const std::vector<TickFacts>* records);

// Periods without a tick before `tick`, which follows `before`.
std::uint64_t skipped_between(const TracedTick& before, const TracedTick& tick, Duration period);
bool is_late(const TracedTick& tick, Duration period);

}  // namespace takt::lab
