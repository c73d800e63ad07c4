// What a CAN controller's error frames and a socket's error numbers mean for the bus. Pure.
// Sources: linux/can/error.h; Documentation/networking/can.rst.
#pragma once

#include <cstdint>
#include <optional>

#include "drivers/can_bus.hpp"

namespace takt::drivers {

// The classes SocketCAN is asked for.
std::uint32_t error_classes() noexcept;

struct BusEvent {
  std::optional<BusState> state;  // the bus is in this state now
  bool frame_lost = false;        // the controller gave up on a frame
};
BusEvent read_error_frame(const CanFrame& error) noexcept;

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
