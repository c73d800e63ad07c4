// SPDX-License-Identifier: Apache-2.0
// The freshness contract inside the loop: each tick's verdict, the exact count of misses, and the hysteresis between
// tracking and degraded mode, in which flapping loses.
//
// A tick misses when the command in use is missing or stale. Ticks count while tracking or degraded only.
// Violated: misses among the last `window_ticks` exceed epsilon * window_ticks. The bound is that of the full window
// from the first tick on: ticks not seen yet count as met. Violated too: no usable command for degrade_after, if set.
// Restored: usable at every tick for recover_after, doubled for each relapse that came within flap_memory of the
// previous restoration, up to 16 times; the window then restarts.
#pragma once

#include <cstdint>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/verdict.hpp"
#include "executive/pipeline/command_in_use.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr std::uint32_t kMaxDoublings = 4;

// Verdict on the command in use. `header` is its header; a stale command stays stale, a spent chunk counts as missing.
Freshness freshness_of(const CommandInUse& command, const CommandHeader& header, MonoTime now,
                       const FreshnessContract& contract);

// The instant from which the chunk is spent: one step period after its last step's.
MonoTime spent_at(const CommandInUse& command, const CommandHeader& header);
// When the command dies: it is max_age old or its chunk is spent, whichever comes first.
MonoTime valid_until(const CommandInUse& command, const CommandHeader& header, const FreshnessContract& contract);

// Memory of the hysteresis.
struct Recovery {
  MonoTime usable_since;    // start of the present unbroken run of usable ticks; unset while broken
  MonoTime last_usable_at;  // newest tick with a usable command; unset before the first
  MonoTime restored_at;     // newest restoration; unset when none since arming
  std::uint32_t relapses = 0;
  std::uint32_t reserved = 0;
};

constexpr bool is_violated(std::uint32_t misses, const Recovery& recovery, MonoTime now,
                           const FreshnessContract& contract) {
  const bool too_long = contract.degrade_after > Duration{} && now - recovery.last_usable_at >= contract.degrade_after;
  return too_long || static_cast<double>(misses) > contract.epsilon * static_cast<double>(contract.window_ticks);
}

void note_freshness(Recovery& recovery, Freshness freshness, MonoTime now);
void note_degraded(Recovery& recovery, MonoTime now, const FreshnessContract& contract);
void note_restored(Recovery& recovery, MonoTime now);
bool is_restored(const Recovery& recovery, MonoTime now, const FreshnessContract& contract);
bool is_command_lost(MonoTime last_usable_at, MonoTime now, const FreshnessContract& contract);

}  // namespace takt::pipeline
