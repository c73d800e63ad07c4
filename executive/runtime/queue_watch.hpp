// SPDX-License-Identifier: Apache-2.0
// Which interfaces hold a setpoint of ours that must not leave any more: a bus that is dead for a while (no node
// acknowledges, an adapter stands still) keeps what was handed to it, and lets it out when it comes back.
//
// A frame is overdue once it has waited for kNormalWait and its command's contract ends within kLead: the purge
// (drivers/bus/transmit_queue.hpp) takes a moment. Setpoints without a command, damping and frames that de-energise,
// may wait for as long as they want. Pure; bounded by the ticks it remembers. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "executive/contract/tick_record.hpp"

namespace takt::runtime {

// A healthy bus carries a tick's frames within a period or two; an adapter on USB may take a few more.
inline constexpr Duration kNormalWait = milliseconds(10);
inline constexpr Duration kLead = milliseconds(20);

using BusMask = std::uint32_t;
static_assert(kMaxBuses <= 32);

class QueueWatch {
 public:
  explicit QueueWatch(Duration max_age) : max_age_(max_age) {}

  // Every tick, in order; one that is left out may hide a deadline, never invent one.
  void take(const TickRecordHeader& tick) noexcept;
  // Bit per bus. A frame is told once: a purge that fails is not tried again for it.
  [[nodiscard]] BusMask overdue(MonoTime now) noexcept;

 private:
  static constexpr std::size_t kTicks = 128;
  struct Sent {
    MonoTime at;
    MonoTime valid_until;  // unset: no command behind its setpoints
  };
  struct Waiting {
    MonoTime since;
    MonoTime valid_until;
    bool told = false;
  };
  [[nodiscard]] MonoTime valid_until_of(MonoTime handed_over) const noexcept;

  Duration max_age_;
  std::array<Sent, kTicks> ticks_{};
  std::size_t next_ = 0;
  std::array<Waiting, kMaxBuses> buses_{};
};

}  // namespace takt::runtime
