// SPDX-License-Identifier: Apache-2.0
// A CAN bus for machines without one: a node's end of the loopback hub (loopback_hub.hpp), over a Unix SOCK_SEQPACKET
// socket that carries one struct canfd_frame per message.
//
// What it does not model: arbitration, bit timing, error counters. The hub says the controller's error frames (injected
// there); they act as on a real bus. A full queue is `queue_full`, the hub's end is BusState::down for good. Stamps are
// the kernel's, taken when the hub passed the frame on. Thread rule: as CanBus; connect() is set-up.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "drivers/bus/bus_options.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/file_handle.hpp"
#include "drivers/bus/id_filter.hpp"
#include "drivers/bus/message_batch.hpp"

namespace takt::drivers {

class LoopbackBus final : public CanBus {
 public:
  static std::expected<std::unique_ptr<LoopbackBus>, std::string> connect(const std::string& socket_path,
                                                                          const BusOptions& options);
  SendResult send(const CanFrame& frame) noexcept override;
  std::size_t receive(std::span<ReceivedFrame> out) noexcept override;
  [[nodiscard]] BusHealth health() const noexcept override { return health_; }

 private:
  LoopbackBus(FileHandle socket, const BusOptions& options) : socket_(std::move(socket)), filter_(options.receive) {}
  std::size_t take(std::size_t fetched, std::span<ReceivedFrame> out) noexcept;

  FileHandle socket_;
  IdFilter filter_;
  MessageBatch batch_;
  BusHealth health_;
};

}  // namespace takt::drivers
