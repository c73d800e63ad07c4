// SPDX-License-Identifier: Apache-2.0
// The port to one CAN bus: what the control loop needs and nothing else. Implementations: SocketCAN, the embedded
// loopback bus. Non-blocking and bounded: send and receive never wait and never allocate.
// Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "executive/contract/feedback.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

struct CanFrame {
  std::uint32_t id = 0;  // 11 bit, or 29 bit when `extended`
  bool extended = false;
  bool fd = false;
  bool bit_rate_switch = false;  // FD only
  bool remote = false;           // remote request: `length` is the length asked for, no data
  bool error = false;            // report by the controller, not a frame: `id` holds the CAN_ERR_* class bits
  std::uint8_t length = 0;       // 0..8, FD: 0..8, 12, 16, 20, 24, 32, 48, 64
  std::uint8_t data[64] = {};
};

struct ReceivedFrame {
  CanFrame frame;
  MonoTime received_at;  // kernel stamp converted to CLOCK_MONOTONIC
};

enum class SendResult : std::uint8_t { sent, queue_full, bus_down };

class CanBus {
 public:
  virtual ~CanBus() = default;
  virtual SendResult send(const CanFrame& frame) noexcept = 0;
  // Fills at most out.size() frames that already arrived; returns how many. Error frames never come out: see health().
  virtual std::size_t receive(std::span<ReceivedFrame> out) noexcept = 0;
  // As known from error frames and send results so far.
  [[nodiscard]] virtual BusHealth health() const noexcept = 0;
};

}  // namespace takt::drivers
