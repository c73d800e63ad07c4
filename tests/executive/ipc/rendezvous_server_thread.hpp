// SPDX-License-Identifier: Apache-2.0
// A rendezvous server that runs in a thread of its own until stopped, so that blocking clients can be tested against
// it.
#pragma once

#include <unistd.h>

#include <atomic>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "executive/ipc/rendezvous.hpp"

namespace takt::ipc {

class ServerThread {
 public:
  ServerThread(const std::string& path, RendezvousServer::Handlers handlers, uid_t allowed_uid = geteuid(),
               std::optional<uid_t> policy_uid = {})
      : server_(listening(path, allowed_uid, std::move(handlers), policy_uid)),
        thread_([this](const std::stop_token& stop) {
          while (!stop.stop_requested()) server_.serve(std::chrono::milliseconds(5));
        }) {}
  // Stops serving; from then on the server may be inspected and driven from the calling thread.
  RendezvousServer& stopped() {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
    return server_;
  }

 private:
  static RendezvousServer listening(const std::string& path, uid_t uid, RendezvousServer::Handlers handlers,
                                    std::optional<uid_t> policy_uid) {
    auto server = RendezvousServer::listen(path, uid, std::move(handlers), policy_uid);
    if (!server) throw std::runtime_error(server.error());
    return std::move(*server);
  }
  RendezvousServer server_;
  std::jthread thread_;
};

}  // namespace takt::ipc
