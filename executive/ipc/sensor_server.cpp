// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/sensor_server.hpp"

#include <unistd.h>

#include <chrono>
#include <csignal>
#include <stop_token>
#include <utility>

namespace takt::ipc {
namespace {

// The thread inherits the mask: the process's signals stay its own.
template <class Body>
std::jthread without_signals(Body body) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  std::jthread thread(std::move(body));
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  return thread;
}

}  // namespace

std::expected<std::unique_ptr<SensorServer>, std::string> SensorServer::start(const std::string& socket_path,
                                                                              std::optional<uid_t> policy_user,
                                                                              const RingShape& shape) {
  auto segment = Segment::create("takt-sensor", ring_bytes(shape), true);
  if (!segment) return std::unexpected(segment.error());
  const int fd = segment->fd();
  RendezvousServer::Handlers handlers;
  handlers.admit = [fd](const Peer& peer) {
    if (peer.hello.role == Role::sensor_reader) return Admission{{}, {fd}};
    return Admission{"this is a sensor: it has nothing for the role " + std::string(name(peer.hello.role)), {}};
  };
  auto server = RendezvousServer::listen(socket_path, ::geteuid(), std::move(handlers), policy_user);
  if (!server) return std::unexpected(server.error());
  auto made = std::unique_ptr<SensorServer>(new SensorServer(std::move(*segment), shape, std::move(*server)));
  // Formatted before it is sealed, sealed before the first reader is greeted.
  if (const auto sealed = made->segment_.seal_against_new_writers(); !sealed) return std::unexpected(sealed.error());
  made->greeter_ = without_signals([&server_of = made->server_](const std::stop_token& stop) {
    while (!stop.stop_requested()) server_of.serve(std::chrono::milliseconds(100));
  });
  return made;
}

SensorServer::SensorServer(Segment segment, const RingShape& shape, RendezvousServer server)
    : segment_(std::move(segment)), writer_(segment_.writable(), shape), server_(std::move(server)) {}

}  // namespace takt::ipc
