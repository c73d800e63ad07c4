// SPDX-License-Identifier: Apache-2.0
// What a bus fault that counts within a window (pipeline/bus_watch.hpp) comes from: an event of just now, or a share of
// the window that still falls to its limit after the last event. A tick that was missed may hide an event, never invent
// one. Pure. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/bus_watch.hpp"

namespace takt::runtime {

class BusShares {
 public:
  explicit BusShares(const pipeline::TickConfig& config) : config_(config) {}  // it outlives this

  // Every tick, in order.
  void take(const TickRecordHeader& tick);
  // While a bus fault holds: one sentence for each bus over its limit without an event for 100 ms, with share, limit
  // and what is left to wait. A bus that is off or down has none: that is told already. nullopt: the fault goes on, or
  // `cause` does not count within a window.
  [[nodiscard]] std::optional<std::vector<std::string>> falling(Cause cause,
                                                                const std::vector<config::Bus>& buses) const;

 private:
  static constexpr std::size_t kKinds = 5;
  struct Bus {
    pipeline::BusWatch watch{};
    BusState state = BusState::up;
    std::array<MonoTime, kKinds> last{};  // event of each kind
  };

  const pipeline::TickConfig& config_;
  std::array<Bus, kMaxBuses> buses_{};
  MonoTime now_;
};

}  // namespace takt::runtime
