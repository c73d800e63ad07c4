// SPDX-License-Identifier: Apache-2.0
// What a CAN controller's error frames and a socket's error numbers mean for the bus; the one place that every bus,
// real or loopback, asks. Pure.
// Sources: linux/can/error.h; Documentation/networking/can.rst.
#pragma once

#include <cstdint>
#include <optional>

#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

// The classes SocketCAN is asked for.
std::uint32_t error_classes() noexcept;

struct BusEvent {
  std::optional<BusState> state{};  // the bus is in this state now
  bool frame_lost = false;          // the controller gave up on a frame of ours
  bool overflowed = false;          // the controller's receive buffer ran over: at least one frame lost
  bool operator==(const BusEvent&) const = default;
};
BusEvent read_error_frame(const CanFrame& error) noexcept;

// The error frame that says `event`, for what stands in for a controller. BusState::down has none: nothing is said.
CanFrame make_error_frame(const BusEvent& event) noexcept;

// What every bus does with an error frame, and before it sends. Both count into `health`.
void note_error_frame(const CanFrame& error, BusHealth& health) noexcept;
// While the bus is off nothing is queued: a restarted controller would deliver stale setpoints. True: counted as
// dropped, do not send.
bool drops_while_off(BusHealth& health) noexcept;

// errno of a failed write:
//   ENOBUFS, EAGAIN        the interface's or the socket's queue is full: frame dropped, bus as it was
//   ENETDOWN               interface administratively down: bus down until a write succeeds again
//   ENXIO, ENODEV, others  interface gone: bus down
struct SendFailure {
  SendResult result = SendResult::queue_full;
  std::optional<BusState> state;
};
SendFailure read_send_error(int error_number) noexcept;

}  // namespace takt::drivers
