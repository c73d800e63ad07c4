// Hands a sensor's mailbox to whoever may read it (policy hosts), and publishes samples into it.
// Thread rule: publish() from one thread; greeting readers happens in a thread of its own. Errors: one sentence.
#pragma once

#include <sys/types.h>

#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "executive/contract/sensor_sample.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::plant {

class SensorServer {
 public:
  // `policy_user`: one more user who may read it, besides our own and root.
  static std::expected<std::unique_ptr<SensorServer>, std::string> start(const std::string& socket_path,
                                                                         std::optional<uid_t> policy_user = {});
  void publish(const SensorSample& sample);

 private:
  SensorServer(ipc::Segment segment, ipc::RendezvousServer server);

  ipc::Segment segment_;
  ipc::SlotWriter writer_;
  ipc::RendezvousServer server_;
  std::jthread greeter_;  // last: ends first
};

}  // namespace takt::plant
