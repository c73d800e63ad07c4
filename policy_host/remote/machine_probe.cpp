// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/machine_probe.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <memory>
#include <utility>

namespace takt::policy_host::remote {
namespace {

constexpr in_port_t kPort = 9;  // discard (RFC 863): a listener there is an answer, too

}  // namespace

std::string address_of(const std::string& interface) {
  ifaddrs* listed = nullptr;
  if (getifaddrs(&listed) != 0) return {};
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owned(listed, &freeifaddrs);
  for (const ifaddrs* each = listed; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr || each->ifa_addr->sa_family != AF_INET || interface != each->ifa_name) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto* const address = reinterpret_cast<const sockaddr_in*>(each->ifa_addr);
    if (inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size()) != nullptr) return text.data();
  }
  return {};
}

void MachineProbe::give_up() {
  for (int& socket : sockets_)
    if (const int fd = std::exchange(socket, -1); fd >= 0) ::close(fd);
}

void MachineProbe::aim(const std::string& address) {
  if (address == address_) return;
  give_up();
  address_ = address;
  tries_ = 0;
  asked_at_ = answered_at_ = {};
  to_ = {};
  to_.sin_port = htons(kPort);
  if (inet_pton(AF_INET, address.c_str(), &to_.sin_addr) == 1) to_.sin_family = AF_INET;
}

void MachineProbe::begin_try(int& socket) const {
  if (socket >= 0) ::close(socket);
  socket = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0) return;
  const linger at_once{1, 0};  // where there is a listener, it is left without ado
  const auto length = static_cast<socklen_t>(interface_.size());
  setsockopt(socket, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  if (setsockopt(socket, SOL_SOCKET, SO_BINDTODEVICE, interface_.data(), length) != 0)
    ::close(std::exchange(socket, -1));
  else
    (void)connect(socket, reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
}

void MachineProbe::ask(MonoTime now, MonoTime silent_since) {
  if (to_.sin_family == 0) return;
  for (int& socket : sockets_) {
    pollfd looked{socket, POLLOUT, 0};
    if (socket < 0 || poll(&looked, 1, 0) <= 0) continue;
    int error = 0;
    socklen_t length = sizeof error;
    getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &length);
    if (error == 0 || error == ECONNREFUSED) answered_at_ = now;
    ::close(std::exchange(socket, -1));
  }
  if (!silent_since.is_set() && (answered_at_.is_set() || tries_ >= kFirstTries)) return;
  if (asked_at_.is_set() && now - asked_at_ < (silent_since.is_set() ? kPeriod : kFarPeriod)) return;
  asked_at_ = now;
  ++tries_;
  begin_try(sockets_.at(next_++ % sockets_.size()));
}

Machine MachineProbe::verdict(MonoTime silent_since) const {
  if (!answered_at_.is_set()) return Machine::unknown;
  return answered_at_ >= silent_since ? Machine::answers : Machine::silent;
}

}  // namespace takt::policy_host::remote
