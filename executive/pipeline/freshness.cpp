// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/freshness.hpp"

#include <algorithm>

namespace takt::pipeline {

MonoTime spent_at(const CommandInUse& command, const CommandHeader& header) {
  return command.begins() + header.step_period * header.step_count;
}

MonoTime valid_until(const CommandInUse& command, const CommandHeader& header, const FreshnessContract& contract) {
  return std::min(command.sensed_at + contract.max_age, spent_at(command, header));
}

Freshness freshness_of(const CommandInUse& command, const CommandHeader& header, MonoTime now,
                       const FreshnessContract& contract) {
  if (command.sequence == 0) return Freshness::missing;
  const Duration age = command.age(now);
  if (age > contract.max_age) return Freshness::stale;
  if (now >= spent_at(command, header)) return Freshness::missing;
  const double aging_from = static_cast<double>(contract.aging_fraction) * static_cast<double>(contract.max_age.ns);
  return static_cast<double>(age.ns) <= aging_from ? Freshness::fresh : Freshness::aging;
}

void note_freshness(Recovery& recovery, Freshness freshness, MonoTime now) {
  if (!is_usable(freshness)) {
    recovery.usable_since = {};
    return;
  }
  if (!recovery.usable_since.is_set()) recovery.usable_since = now;
  recovery.last_usable_at = now;
}

void note_miss(Recovery& recovery, bool missed, const FreshnessContract& contract) {
  recovery.silence = missed ? recovery.silence + 1 : 0;
  recovery.longest_silence = std::max(recovery.longest_silence, recovery.silence);
  const float share = (missed ? 1.0F : 0.0F) - static_cast<float>(contract.epsilon);
  recovery.excess = std::max(recovery.excess + share, 0.0F);
  if (recovery.excess == 0.0F) recovery.longest_silence = recovery.silence;
}

void forget_misses(Recovery& recovery) {
  recovery.excess = 0;
  recovery.silence = recovery.longest_silence = 0;
}

void note_degraded(Recovery& recovery, MonoTime now, const FreshnessContract& contract) {
  const bool relapse = recovery.restored_at.is_set() && now - recovery.restored_at <= contract.flap_memory;
  recovery.relapses = relapse ? std::min(recovery.relapses + 1, kMaxDoublings) : 0;
  recovery.usable_since = {};
}

void note_restored(Recovery& recovery, MonoTime now) {
  recovery.restored_at = now;
}

bool is_restored(const Recovery& recovery, MonoTime now, const FreshnessContract& contract) {
  const Duration needed = contract.recover_after * (std::int64_t{1} << recovery.relapses);
  return recovery.usable_since.is_set() && now - recovery.usable_since >= needed;
}

bool is_command_lost(MonoTime last_usable_at, MonoTime now, const FreshnessContract& contract) {
  return now - last_usable_at >= contract.stop_after;
}

}  // namespace takt::pipeline
