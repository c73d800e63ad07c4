// SPDX-License-Identifier: Apache-2.0
// The wire of a loopback bus: passes every frame a node sends on to every other node. It belongs to takt-plant, which
// is a node itself: the hub is the plant's own CanBus.
//
// Bounded: at most kMaxNodes nodes; what does not fit into a slow node's socket buffer is dropped for that node alone
// and counted. A node that sends anything but a struct canfd_frame, or an error frame, is disconnected.
//
// Fault injection, for tests and the plant's scenarios: the nodes see what a real controller would show them. Off at
// first. A flood or a stranger needs nothing of its own: send() frames on any id.
// Thread rule: one thread at a time, which must call receive() or pump() regularly; nothing moves in between.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "drivers/bus/bus_options.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/file_handle.hpp"
#include "drivers/bus/id_filter.hpp"
#include "drivers/bus/message_batch.hpp"

namespace takt::drivers {

// Each lasts until inject() takes it back. When several hold, a stall comes first, then the losses.
struct LoopbackFaults {
  // Nothing is read from the nodes: their queues fill, then their send() says queue_full. What was queued flows when
  // the stall ends. pump() does not wait meanwhile.
  bool stalled = false;
  bool drop_from_nodes = false;  // what the nodes send is dropped
  bool drop_to_nodes = false;    // what the hub's own node sends is dropped
  // As drop_from_nodes, and the sender's controller reports every frame it gave up (tx_dropped grows).
  bool refuse_transmit = false;
};

class LoopbackHub final : public CanBus {
 public:
  static constexpr std::size_t kMaxNodes = 16;

  // Makes the directory if absent; replaces a dead predecessor's socket, respects a live one.
  static std::expected<std::unique_ptr<LoopbackHub>, std::string> listen(const std::string& socket_path,
                                                                         const BusOptions& own_node);
  ~LoopbackHub() override;
  LoopbackHub(const LoopbackHub&) = delete;
  LoopbackHub& operator=(const LoopbackHub&) = delete;

  // As the hub's own node. Received frames were passed on to the others when this returns; frames for which `out` has
  // no room stay in their sender's queue.
  SendResult send(const CanFrame& frame) noexcept override;
  std::size_t receive(std::span<ReceivedFrame> out) noexcept override;
  [[nodiscard]] BusHealth health() const noexcept override { return health_; }  // tx_dropped: over all nodes

  // Without a node of its own: waits at most `timeout` for frames and passes them on. Returns how many.
  std::size_t pump(Duration timeout) noexcept;
  [[nodiscard]] std::size_t node_count() const { return nodes_.size(); }

  void inject(const LoopbackFaults& faults) noexcept { faults_ = faults; }
  [[nodiscard]] const LoopbackFaults& faults() const { return faults_; }
  // Every node's controller, the hub's own among them, enters this state and says so by an error frame: up,
  // error_passive or bus_off. While off, no frame passes. BusState::down is no controller's word: ignored (destroy the
  // hub for that). A node that connects later is not told.
  void report_error_state(BusState state) noexcept;
  void report_receive_overflow() noexcept;  // every other node's controller lost at least one frame: rx_dropped grows

 private:
  LoopbackHub(FileHandle listener, FileHandle poll, std::string path, const BusOptions& own_node);
  void accept_nodes() noexcept;
  void disconnect(int socket) noexcept;
  void pass_on(const canfd_frame& frame, int from) noexcept;
  void lose(int from) noexcept;
  [[nodiscard]] bool is_off() const { return health_.state == BusState::bus_off; }
  std::size_t serve(int socket, std::span<ReceivedFrame> out) noexcept;
  std::size_t serve_ready(int timeout_ms, std::span<ReceivedFrame> out) noexcept;

  FileHandle listener_;
  FileHandle poll_;
  std::string path_;
  IdFilter filter_;
  std::vector<FileHandle> nodes_;  // reserved for kMaxNodes
  MessageBatch batch_;
  LoopbackFaults faults_;
  BusHealth health_;
};

}  // namespace takt::drivers
