// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/machine_probe.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <memory>

namespace takt::policy_host::remote {
namespace {

constexpr in_port_t kPort = 9;  // discard (RFC 863): whoever has a listener there is asked in vain, and harmlessly

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

void MachineProbe::close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

void MachineProbe::aim(const std::string& address) {
  if (address == address_) return;
  close();
  address_ = address;
  tries_ = 0;
  asked_at_ = answered_at_ = {};
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(kPort);
  if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1) return;
  socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return;
  if (setsockopt(socket_, SOL_SOCKET, SO_BINDTODEVICE, interface_.data(), static_cast<socklen_t>(interface_.size())) !=
          0 ||
      connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0)
    close();
}

void MachineProbe::ask(MonoTime now, MonoTime silent_since) {
  if (socket_ < 0) return;
  std::array<char, 1> nothing{};
  if (recv(socket_, nothing.data(), nothing.size(), 0) < 0 && errno == ECONNREFUSED) answered_at_ = now;
  if (!silent_since.is_set() && (answered_at_.is_set() || tries_ >= kFirstTries)) return;
  if (asked_at_.is_set() && now - asked_at_ < (silent_since.is_set() ? kPeriod : kFarPeriod)) return;
  asked_at_ = now;
  ++tries_;
  // A refusal of an earlier one may be told here as well.
  if (send(socket_, nothing.data(), 0, 0) < 0 && errno == ECONNREFUSED) answered_at_ = now;
}

Machine MachineProbe::verdict(MonoTime silent_since) const {
  if (!answered_at_.is_set()) return Machine::unknown;
  return answered_at_ >= silent_since ? Machine::answers : Machine::silent;
}

}  // namespace takt::policy_host::remote
