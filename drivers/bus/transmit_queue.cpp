// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/transmit_queue.hpp"

#include <linux/can.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "drivers/bus/file_handle.hpp"

namespace takt::drivers {

std::expected<void, std::string> purge_transmit_queue(const std::string& interface) {
  const auto refused = [&interface](const char* what) {
    const int error = errno;
    return std::unexpected(interface + ": " + what + " (" + std::strerror(error) + ")" +
                           (error == EPERM ? ": needs CAP_NET_ADMIN, which takt-executive.service has" : ""));
  };
  const FileHandle socket(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (!socket.is_open()) return refused("no raw CAN socket to be had");
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  if (::ioctl(socket.get(), SIOCGIFFLAGS, &request) != 0) return refused("the interface does not say its state");
  const auto flags = request.ifr_flags;
  request.ifr_flags = static_cast<short>(flags & ~IFF_UP);
  if (::ioctl(socket.get(), SIOCSIFFLAGS, &request) != 0) return refused("cannot be switched off");
  request.ifr_flags = static_cast<short>(flags | IFF_UP);
  if (::ioctl(socket.get(), SIOCSIFFLAGS, &request) != 0) return refused("was switched off and cannot be switched on");
  return {};
}

}  // namespace takt::drivers
