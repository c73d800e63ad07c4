// SPDX-License-Identifier: Apache-2.0
// When a tick's frames were on the wire, by what the controllers said (BusHealth::left_at, waiting_since): the last
// part of a command's age, from the tick to the bus.
//
// A tick's frames of a bus have left once the bus lets a later tick's wait, or none. Told is when the newest of them
// left, at the latest: while a slow adapter is a tick behind, a frame of the next tick may be what left last. A tick of
// which nothing is known (the bus does not say, frames were lost or thrown away) is left out. Ticks in order; gaps are
// allowed. No allocation. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "executive/contract/tick_record.hpp"

namespace takt::monitor {

struct OnWire {
  Duration since_tick;          // from the tick's begin
  std::optional<Duration> age;  // of the command it played, at that instant; none: it played none
};

class WireWatch {
 public:
  using PerBus = std::array<std::optional<OnWire>, kMaxBuses>;
  // What is known since this tick about an earlier one; at most one tick per bus and call, the newest.
  PerBus take(const TickRecordHeader& tick) noexcept;

 private:
  static constexpr std::size_t kTicks = 64;
  struct Tick {
    std::uint64_t number = 0;  // 0: none
    MonoTime now;
    std::optional<Duration> age;
  };
  [[nodiscard]] const Tick* newest_before(MonoTime when) const noexcept;

  std::array<Tick, kTicks> ticks_{};
  std::size_t next_ = 0;
  std::array<std::uint64_t, kMaxBuses> told_{};  // newest tick that was told
};

}  // namespace takt::monitor
