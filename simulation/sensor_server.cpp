#include "simulation/sensor_server.hpp"

#include <unistd.h>

#include <chrono>
#include <span>
#include <stop_token>

#include "executive/ipc/executive_segments.hpp"

namespace takt::plant {

std::expected<std::unique_ptr<SensorServer>, std::string> SensorServer::start(const std::string& socket_path,
                                                                              std::optional<uid_t> policy_user) {
  auto segment = ipc::Segment::create("takt-sensor", ipc::ring_bytes(ipc::sensor_mailbox()), true);
  if (!segment) return std::unexpected(segment.error());
  const int fd = segment->fd();
  ipc::RendezvousServer::Handlers handlers;
  handlers.admit = [fd](const ipc::Peer& peer) {
    if (peer.hello.role == Role::sensor_reader) return ipc::Admission{{}, {fd}};
    return ipc::Admission{"this is a sensor: it has nothing for the role " + std::string(name(peer.hello.role)), {}};
  };
  auto server = ipc::RendezvousServer::listen(socket_path, ::geteuid(), std::move(handlers), policy_user);
  if (!server) return std::unexpected(server.error());
  auto made = std::unique_ptr<SensorServer>(new SensorServer(std::move(*segment), std::move(*server)));
  // Formatted before it is sealed, sealed before the first reader is greeted.
  if (const auto sealed = made->segment_.seal_against_new_writers(); !sealed) return std::unexpected(sealed.error());
  made->greeter_ = std::jthread([&server_of = made->server_](const std::stop_token& stop) {
    while (!stop.stop_requested()) server_of.serve(std::chrono::milliseconds(100));
  });
  return made;
}

SensorServer::SensorServer(ipc::Segment segment, ipc::RendezvousServer server)
    : segment_(std::move(segment)), writer_(segment_.writable(), ipc::sensor_mailbox()), server_(std::move(server)) {}

void SensorServer::publish(const SensorSample& sample) {
  writer_.publish(std::as_bytes(std::span(&sample, 1)));
}

}  // namespace takt::plant
