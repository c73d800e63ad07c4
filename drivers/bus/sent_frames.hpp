// SPDX-License-Identifier: Apache-2.0
// Our own frames between the write and the wire: which were handed to the kernel, and which have left since.
//
// A controller hands a frame back once it is on the wire. Frames leave in the order in which they were handed over, so
// one that comes back also ends the wait of those before it: they were lost on the way. What comes back and was not
// handed over, or was already believed lost, says nothing. The kRoom oldest that wait are followed; once a frame comes
// back that is none of them, though more were handed over than that, they were lost. Thread rule: one thread at a time.
// No allocation; bounded by kRoom.
#pragma once

#include <array>
#include <cstddef>

#include "drivers/bus/can_bus.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

class SentFrames {
 public:
  static constexpr std::size_t kRoom = 64;

  void handed_over(const CanFrame& frame, MonoTime now) noexcept;
  // `frame` was on the wire at `stamp`.
  void left(const CanFrame& frame, MonoTime stamp) noexcept;
  // What waited was thrown away: the interface went down, or the controller off the bus.
  void forget() noexcept;

  [[nodiscard]] MonoTime left_at() const noexcept { return left_at_; }
  [[nodiscard]] MonoTime waiting_since() const noexcept { return count_ == 0 ? MonoTime{} : at(0).since; }

 private:
  struct Sent {
    CanFrame frame;
    MonoTime since;
  };
  [[nodiscard]] const Sent& at(std::size_t index) const noexcept { return frames_[(first_ + index) % kRoom]; }
  void drop(std::size_t frames) noexcept;

  std::array<Sent, kRoom> frames_{};
  std::size_t first_ = 0, count_ = 0;
  bool has_more_ = false;  // were handed over while there was no room
  MonoTime left_at_;
};

}  // namespace takt::drivers
