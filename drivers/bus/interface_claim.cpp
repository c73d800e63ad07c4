// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/interface_claim.hpp"

#include <net/if.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstddef>
#include <cstring>

namespace takt::drivers {
namespace {

struct AbstractName {
  sockaddr_un address{};
  socklen_t size = 0;
};

AbstractName name_of(unsigned interface_index) {
  const std::string text = "takt/can/" + std::to_string(interface_index);
  AbstractName name;
  name.address.sun_family = AF_UNIX;
  text.copy(name.address.sun_path + 1, text.size());  // byte 0 stays zero: no file
  name.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
  return name;
}

FileHandle open_socket() {
  return FileHandle(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

// " (pid 412, uid 998)"; empty when it does not take our call.
std::string holder_of(const AbstractName& name) {
  const FileHandle call = open_socket();
  ucred holder{};
  socklen_t size = sizeof holder;
  if (::connect(call.get(), reinterpret_cast<const sockaddr*>(&name.address), name.size) != 0 ||
      ::getsockopt(call.get(), SOL_SOCKET, SO_PEERCRED, &holder, &size) != 0)
    return {};
  return " (pid " + std::to_string(holder.pid) + ", uid " + std::to_string(holder.uid) + ")";
}

}  // namespace

std::expected<InterfaceClaim, std::string> InterfaceClaim::make(const std::string& interface) {
  const AbstractName name = name_of(::if_nametoindex(interface.c_str()));
  FileHandle socket = open_socket();
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&name.address), name.size) == 0 &&
      ::listen(socket.get(), 1) == 0)
    return InterfaceClaim(std::move(socket));
  if (errno != EADDRINUSE) return std::unexpected(interface + ": cannot be claimed (" + std::strerror(errno) + ")");
  return std::unexpected(
      interface + ": another process of Takt" + holder_of(name) +
      " sends on this interface already: two masters on one bus fight over its drives; end it first");
}

}  // namespace takt::drivers
