// SPDX-License-Identifier: Apache-2.0
// Hands a sensor's mailbox to its permitted readers (policy hosts, the executive), and publishes samples into it. The
// one way in which a sensor is served, whatever plays it: the simulator, or a process from outside (takt/client.h).
//
// A sample is either written in place, begin() then commit(), or copied by publish(). A process that dies between begin
// and commit leaves the sample before readable.
// Thread rule: samples from one thread; greeting readers happens in a thread of its own, which takes no signals.
// Errors: one sentence.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <expected>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "executive/contract/sensor_sample.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {

class SensorServer {
 public:
  // `policy_user`: one more user who may read it, besides our own and root.
  static std::expected<std::unique_ptr<SensorServer>, std::string> start(const std::string& socket_path,
                                                                         std::optional<uid_t> policy_user = {},
                                                                         const RingShape& shape = sensor_mailbox());
  SensorServer(const SensorServer&) = delete;
  SensorServer& operator=(const SensorServer&) = delete;
  ~SensorServer() = default;

  void publish(const SensorSample& sample) { writer_.publish(std::as_bytes(std::span(&sample, 1))); }

  // As SlotWriter's.
  std::span<std::byte> begin() noexcept { return writer_.begin(); }
  void commit(std::size_t bytes) noexcept { writer_.commit(bytes); }

 private:
  SensorServer(Segment segment, const RingShape& shape, RendezvousServer server);

  Segment segment_;
  SlotWriter writer_;
  RendezvousServer server_;
  std::jthread greeter_;  // last: ends first
};

}  // namespace takt::ipc
