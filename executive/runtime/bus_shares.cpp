// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/bus_shares.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace takt::runtime {
namespace {

using pipeline::BusFaultLimits;
using pipeline::BusWatch;
using pipeline::LeakyCount;

constexpr Duration kJustNow = milliseconds(100);

struct Kind {
  Cause cause;
  LeakyCount BusWatch::*count;
  std::uint32_t BusFaultLimits::*limit;
  std::string_view key;    // below bus_faults
  std::string_view event;  // "no ..."
};
constexpr std::array<Kind, 5> kKindsOfEvents = {{
    {Cause::transmit_queue_full, &BusWatch::transmit_drops, &BusFaultLimits::transmit_drops, "transmit_drops",
     "dropped frame"},
    {Cause::receive_overflow, &BusWatch::receive_drops, &BusFaultLimits::receive_drops, "receive_drops", "lost frame"},
    {Cause::foreign_node, &BusWatch::foreign, &BusFaultLimits::foreign_frames, "foreign_frames", "foreign frame"},
    {Cause::bus_babble, &BusWatch::babble, &BusFaultLimits::babble, "babble", "surplus frame"},
    {Cause::bus_error_passive, &BusWatch::error_passive, &BusFaultLimits::error_passive, "error_passive",
     "error-passive state"},
}};

double percent(double share) {
  return 100 * share;
}

}  // namespace

void BusShares::take(const TickRecordHeader& tick) {
  now_ = tick.now;
  const std::uint32_t window = config_.bus_faults.window_ticks;
  for (std::size_t b = 0; b < std::min<std::size_t>(tick.bus_count, kMaxBuses); ++b) {
    Bus& bus = buses_[b];
    const BusWatch before = bus.watch;
    pipeline::note_health(bus.watch, tick.buses[b], window);
    bus.state = tick.buses[b].state;
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      const double share = (bus.watch.*kKindsOfEvents[kind].count).share(window);
      // It falls in every tick without an event.
      if (share > 0 && share >= (before.*kKindsOfEvents[kind].count).share(window)) bus.last[kind] = tick.now;
    }
  }
}

std::optional<std::vector<std::string>> BusShares::falling(Cause cause, const std::vector<config::Bus>& buses) const {
  static_assert(kKindsOfEvents.size() == kKinds);
  const auto kind = std::ranges::find(kKindsOfEvents, cause, &Kind::cause);
  if (kind == kKindsOfEvents.end()) return std::nullopt;
  const auto index = static_cast<std::size_t>(kind - kKindsOfEvents.begin());
  const std::uint32_t window = config_.bus_faults.window_ticks;
  const double limit = static_cast<double>(config_.bus_faults.*kind->limit) / pipeline::kWholeShare;
  std::vector<std::string> sentences;
  bool is_told_already = false;
  for (std::size_t b = 0; b < std::min(buses.size(), buses_.size()); ++b) {
    const double share = (buses_[b].watch.*kind->count).share(window);
    if (share <= limit) continue;
    if (buses_[b].state == BusState::bus_off || buses_[b].state == BusState::down) {
      is_told_already = true;
      continue;
    }
    const Duration since = now_ - buses_[b].last[index];
    if (since < kJustNow) return std::nullopt;
    const std::string wait =
        limit > 0 ? fmt::format("wait {:.1f} s", std::log(share / limit) * config_.period.seconds() * window)
                  : std::string("wait until it is 0");
    sentences.push_back(fmt::format(
        "bus {}: no {} for {:.1f} s, but bus_faults.{} is still {:.2g} % (limit {:g} %): {}", buses[b].name,
        kind->event, since.seconds(), kind->key, percent(share), percent(std::round(limit * 1e4) / 1e4), wait));
  }
  if (sentences.empty() && !is_told_already) return std::nullopt;
  return sentences;
}

}  // namespace takt::runtime
