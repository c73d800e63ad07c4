// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/queue_watch.hpp"

#include <algorithm>

#include "executive/contract/tick_facts.hpp"

namespace takt::runtime {

void QueueWatch::take(const TickRecordHeader& tick) noexcept {
  // First what the bus said: it is about the ticks before this one.
  for (std::size_t bus = 0; bus < std::min<std::size_t>(tick.bus_count, kMaxBuses); ++bus) {
    const MonoTime since = tick.buses[bus].waiting_since;
    if (since != buses_[bus].since) buses_[bus] = {since, valid_until_of(since)};
  }
  const std::optional<Duration> age = age_of_played(tick);
  const MonoTime sample = age ? tick.now - *age : MonoTime{};
  ticks_[next_ % kTicks] = {tick.now, sample.is_set() ? sample + max_age_ : MonoTime{}};
  ++next_;
}

MonoTime QueueWatch::valid_until_of(MonoTime handed_over) const noexcept {
  for (std::size_t back = 1; back <= std::min(next_, kTicks); ++back) {
    const Sent& tick = ticks_[(next_ - back) % kTicks];
    if (tick.at <= handed_over) return handed_over.is_set() ? tick.valid_until : MonoTime{};
  }
  return {};
}

BusMask QueueWatch::overdue(MonoTime now) noexcept {
  BusMask found = 0;
  for (std::size_t bus = 0; bus < kMaxBuses; ++bus) {
    Waiting& waiting = buses_[bus];
    if (waiting.told || !waiting.valid_until.is_set()) continue;
    if (now - waiting.since < kNormalWait || now + kLead < waiting.valid_until) continue;
    waiting.told = true;
    found |= BusMask{1} << bus;
  }
  return found;
}

}  // namespace takt::runtime
