// Hands a sensor's mailbox to whoever may read it (policy hosts), and publishes samples into it.
// Thread rule: publish() from one thread; greeting readers happens in a thread of its own. Errors: one sentence.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <thread>

#include "executive/contract/sensor_sample.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::plant {

class SensorServer {
 public:
  static std::expected<std::unique_ptr<SensorServer>, std::string> start(const std::string& socket_path);
  void publish(const SensorSample& sample);

 private:
  SensorServer(ipc::Segment segment, ipc::RendezvousServer server);

  ipc::Segment segment_;
  ipc::SlotWriter writer_;
  ipc::RendezvousServer server_;
  std::jthread greeter_;  // last: ends first
};

}  // namespace takt::plant
