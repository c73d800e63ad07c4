// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/command_context.hpp"

#include <algorithm>
#include <span>

namespace takt::lab {
namespace {

// From the last tick at or before the sensing to the tick of first use.
std::span<const TracedTick> ticks_during(const CommandChain& chain, const TracedExecutive& executive) {
  const auto& ticks = executive.ticks;
  const auto end = std::ranges::upper_bound(ticks, chain.tick, {}, &TracedTick::tick);
  auto begin = end;
  const MonoTime from = chain.sensed.is_set() ? chain.sensed : chain.consumed;
  while (begin != ticks.begin() && !(begin != end && begin->now.is_set() && begin->now <= from)) --begin;
  return {begin, end};
}

void add_tick(const TracedTick& tick, Duration period, CommandContext& context) {
  context.worst_lateness = std::max(context.worst_lateness, tick.lateness);
  if (is_late(tick, period)) ++context.late_wakeups;
  if (!tick.end_at.is_set()) return;
  if (tick.begin_at.is_set()) context.longest_tick = std::max(context.longest_tick, tick.end_at - tick.begin_at);
  const auto mode = static_cast<Mode>(tick.mode);
  if (context.modes.empty() || context.modes.back() != mode) context.modes.push_back(mode);
}

}  // namespace

std::uint64_t skipped_between(const TracedTick& before, const TracedTick& tick, Duration period) {
  if (!before.now.is_set() || !tick.now.is_set() || tick.tick != before.tick + 1 || period.ns <= 0) return 0;
  // Of the scheduled instants, which lateness does not move.
  const Duration distance = (tick.now - tick.lateness) - (before.now - before.lateness);
  const std::int64_t periods = (distance.ns + period.ns / 2) / period.ns;
  return periods > 1 ? static_cast<std::uint64_t>(periods - 1) : 0;
}

bool is_late(const TracedTick& tick, Duration period) {
  return tick.lateness.ns * kLateShare > period.ns;
}

CommandContext context_of(const CommandChain& chain, const TracedExecutive& executive, Duration period,
                          const std::vector<TickFacts>* records) {
  CommandContext context;
  const auto ticks = ticks_during(chain, executive);
  if (ticks.empty()) return context;
  context.first_tick = ticks.front().tick;
  context.last_tick = ticks.back().tick;
  context.untraced_ticks = context.last_tick - context.first_tick + 1 - ticks.size();
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    add_tick(ticks[i], period, context);
    if (i != 0) context.skipped_periods += skipped_between(ticks[i - 1], ticks[i], period);
  }
  for (const Consumption& read : executive.consumptions) {
    if (read.tick < context.first_tick || read.tick > context.last_tick) continue;
    if (read.arrival != static_cast<std::uint8_t>(Arrival::accepted)) ++context.refused_messages;
  }
  if (records == nullptr) return context;
  const auto first = std::ranges::lower_bound(*records, context.first_tick, {}, &TickFacts::tick);
  for (auto record = first; record != records->end() && record->tick <= context.last_tick; ++record)
    if (const auto cause = static_cast<std::size_t>(record->overrun_cause); cause < context.overruns.size())
      ++context.overruns[cause];
  return context;
}

}  // namespace takt::lab
