// SPDX-License-Identifier: Apache-2.0
// The freshness contract inside the loop: each tick's verdict, the exact count of misses, and the hysteresis between
// tracking and degraded mode, in which flapping loses.
//
// A tick misses when the command in use is missing or stale. Ticks count while tracking or degraded only.
//
// Late: no usable command for degrade_after, if set, or for more ticks in a row than epsilon * window_ticks. A silence
// is met at once, and says nothing of how often one comes.
//
// Violated: evidence that more than epsilon of the ticks miss. A miss adds 1 - epsilon to the excess, a tick that is
// met takes epsilon off, and it is never below zero. Misses come in silences, so the excess that proves something grows
// with their length: it must exceed kEvidence times the longest silence since it was last zero, and epsilon *
// window_ticks. It is a queue served at the rate epsilon: silences of one length at random, at half of epsilon, get it
// beyond h with a probability of exp(-1.25 h / length), once in a million silences; at twice epsilon it is there after
// kEvidence / epsilon lengths.
//
// Restored: usable at every tick for recover_after, doubled for each relapse that came within flap_memory of the
// previous restoration, up to 16 times; excess and window then restart.
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

// Memory of the hysteresis, and of the evidence against the policy.
struct Recovery {
  MonoTime usable_since;    // start of the present unbroken run of usable ticks; unset while broken
  MonoTime last_usable_at;  // newest tick with a usable command; unset before the first
  MonoTime restored_at;     // newest restoration; unset when none since arming
  std::uint32_t relapses = 0;
  float excess = 0;                   // misses beyond epsilon, in ticks
  std::uint32_t silence = 0;          // misses in a row, up to now
  std::uint32_t longest_silence = 0;  // since the excess was last zero
};

// Longest silences: the more, the surer and the later.
inline constexpr double kEvidence = 11;

constexpr bool is_violated(const Recovery& recovery, const FreshnessContract& contract) {
  const double excess = static_cast<double>(recovery.excess);
  return excess > contract.epsilon * static_cast<double>(contract.window_ticks) &&
         excess > kEvidence * static_cast<double>(recovery.longest_silence);
}

constexpr bool is_late(const Recovery& recovery, MonoTime now, const FreshnessContract& contract) {
  const bool too_long = contract.degrade_after > Duration{} && now - recovery.last_usable_at >= contract.degrade_after;
  const double allowed = contract.epsilon * static_cast<double>(contract.window_ticks);
  return too_long || (contract.epsilon < 1 && static_cast<double>(recovery.silence) > allowed);
}

// A tick that counts.
void note_miss(Recovery& recovery, bool missed, const FreshnessContract& contract);
void forget_misses(Recovery& recovery);
void note_freshness(Recovery& recovery, Freshness freshness, MonoTime now);
void note_degraded(Recovery& recovery, MonoTime now, const FreshnessContract& contract);
void note_restored(Recovery& recovery, MonoTime now);
bool is_restored(const Recovery& recovery, MonoTime now, const FreshnessContract& contract);
bool is_command_lost(MonoTime last_usable_at, MonoTime now, const FreshnessContract& contract);

}  // namespace takt::pipeline
