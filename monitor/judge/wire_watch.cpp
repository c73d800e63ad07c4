// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/wire_watch.hpp"

#include <algorithm>

#include "executive/contract/tick_facts.hpp"

namespace takt::monitor {

WireWatch::PerBus WireWatch::take(const TickRecordHeader& tick) noexcept {
  PerBus found;
  for (std::size_t bus = 0; bus < std::min<std::size_t>(tick.bus_count, kMaxBuses); ++bus) {
    const BusHealth& health = tick.buses[bus];
    // The tick whose frames wait is not over; unset: none waits, and the newest before this one is.
    const Tick* over = newest_before(tick.now);
    if (health.waiting_since.is_set()) {
      const Tick* const waiting = newest_before(health.waiting_since + nanoseconds(1));
      over = waiting == nullptr ? nullptr : newest_before(waiting->now);
    }
    if (over == nullptr || over->number <= told_[bus] || health.left_at < over->now) continue;
    told_[bus] = over->number;
    const Duration since_tick = health.left_at - over->now;
    found[bus] = {since_tick, over->age ? std::optional(*over->age + since_tick) : std::nullopt};
  }
  ticks_[next_ % kTicks] = {tick.tick, tick.now, age_of_played(tick)};
  ++next_;
  return found;
}

const WireWatch::Tick* WireWatch::newest_before(MonoTime when) const noexcept {
  for (std::size_t back = 1; back <= std::min(next_, kTicks); ++back) {
    const Tick& tick = ticks_[(next_ - back) % kTicks];
    if (tick.now < when) return &tick;
  }
  return nullptr;
}

}  // namespace takt::monitor
