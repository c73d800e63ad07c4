// SPDX-License-Identifier: Apache-2.0
// A real CAN interface through a non-blocking raw socket.
//
// Set-up: kernel filters for the wanted ids only, error frames for bus-off, error-passive, transmit time-out and
// restart, kernel receive stamps and drop counts. Afterwards one system call per sent frame, one per 32 received. While
// the bus is off nothing is queued: a restarted controller would deliver stale setpoints.
//
// A controller that hands our frames back once they are on the wire (IFF_ECHO) is asked to: its stamps say when a frame
// left, and what still waits. Where the kernel itself would hand them back, at the write, this is unknown.
// Errors of open(): one sentence. Thread rule: as CanBus; open() is set-up. Source: Documentation/networking/can.rst.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "drivers/bus/bus_options.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/file_handle.hpp"
#include "drivers/bus/message_batch.hpp"
#include "drivers/bus/sent_frames.hpp"

namespace takt::drivers {

class SocketCanBus final : public CanBus {
 public:
  static bool interface_exists(const std::string& interface);
  // By where the device hangs: vcan and its like, where no drive can be. An interface over a serial line counts as one.
  static bool is_virtual(const std::string& interface);
  // It exists and is not virtual: real drives may be there.
  static bool has_hardware(const std::string& interface);
  static std::expected<std::unique_ptr<SocketCanBus>, std::string> open(const BusOptions& options,
                                                                        std::uint32_t bitrate);
  // Takes a socket that is already set up (tests use a socket pair: there, as here, one message is one frame).
  explicit SocketCanBus(FileHandle socket, bool says_what_left = false)
      : socket_(std::move(socket)), says_what_left_(says_what_left) {}

  SendResult send(const CanFrame& frame) noexcept override;
  std::size_t receive(std::span<ReceivedFrame> out) noexcept override;
  [[nodiscard]] BusHealth health() const noexcept override;

 private:
  void set_state(BusState state) noexcept;
  bool take(std::size_t index, const ClockPair& clocks, ReceivedFrame& out) noexcept;

  FileHandle socket_;
  MessageBatch batch_;
  BusHealth health_;
  SentFrames sent_;
  bool says_what_left_;
  std::uint32_t kernel_dropped_ = 0;  // SO_RXQ_OVFL's newest total
};

}  // namespace takt::drivers
