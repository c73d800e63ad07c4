// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/loopback_socket.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "drivers/bus/can_frame.hpp"

namespace takt::drivers {

std::expected<sockaddr_un, std::string> loopback_address(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path)
    return std::unexpected(path + ": longer than the " + std::to_string(sizeof address.sun_path - 1) +
                           " bytes a socket path may have: choose a shorter --runtime-dir");
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

FileHandle open_loopback_socket() {
  return FileHandle(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

void ask_for_stamps(int socket) {
  const int on = 1;
  // Where it is not to be had, frames are of unknown age: older than any feedback may be.
  (void)::setsockopt(socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
}

FrameOut write_frame(int socket, const canfd_frame& frame) noexcept {
  if (::send(socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return FrameOut::sent;
  return errno == EAGAIN || errno == ENOBUFS || errno == EINTR ? FrameOut::full : FrameOut::closed;
}

std::optional<ReceivedFrame> frame_of(const MessageBatch& batch, std::size_t index, const ClockPair& clocks) noexcept {
  if (batch.size(index) != sizeof(canfd_frame)) return std::nullopt;
  const std::optional<CanFrame> frame = from_kernel(batch.frame(index));
  if (!frame) return std::nullopt;
  return ReceivedFrame{*frame, to_monotonic(batch.control(index).realtime_ns, clocks)};
}

}  // namespace takt::drivers
