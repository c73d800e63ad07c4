// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/stop_line.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <span>
#include <utility>

#include "executive/ipc/unix_socket.hpp"

namespace takt::ipc {
namespace {

constexpr int kQueueDrainsWithinMs = 100;

Descriptor open_datagram() {
  return Descriptor(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
}

bool is_request(const OperatorMessage& message, ssize_t size) {
  return size == sizeof message && message.magic == kMagic && is_stop(message.verb);
}

// `is_policys`: the kernel says that it comes from behind a policy's boundary. In doubt it does not: a stop counts.
ssize_t receive(int socket, OperatorMessage& message, bool& is_policys) noexcept {
  union {
    cmsghdr aligned;
    std::array<std::byte, CMSG_SPACE(sizeof(ucred))> bytes;
  } control{};
  iovec part{&message, sizeof message};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  header.msg_control = &control;
  header.msg_controllen = sizeof control;
  const ssize_t size = recvmsg(socket, &header, MSG_TRUNC | MSG_CMSG_CLOEXEC);
  const cmsghdr* const said = size >= 0 ? CMSG_FIRSTHDR(&header) : nullptr;
  if (said == nullptr || said->cmsg_level != SOL_SOCKET || said->cmsg_type != SCM_CREDENTIALS) return size;
  ucred sender{};
  std::memcpy(&sender, CMSG_DATA(said), sizeof sender);
  is_policys = sender.pid > 0 && user_namespace_of(sender.pid) == UserNamespace::another;
  return size;
}

}  // namespace

std::string stop_socket_beside(const std::string& executive_socket) {
  const std::size_t slash = executive_socket.rfind('/');
  return executive_socket.substr(0, slash == std::string::npos ? 0 : slash + 1) + "stop.sock";
}

StopLine::StopLine(Descriptor socket, std::string path) : socket_(std::move(socket)), path_(std::move(path)) {}

StopLine::~StopLine() {
  if (socket_.is_open()) unlink(path_.c_str());
}

std::expected<StopLine, std::string> StopLine::listen(const std::string& path) {
  if (auto checked = check_path(path); !checked) return std::unexpected(checked.error());
  Descriptor socket = open_datagram();
  unlink(path.c_str());
  const sockaddr_un address = address_of(path);
  if (!socket.is_open() || bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return std::unexpected("stop line: cannot listen at " + path + ": " + errno_text());
  constexpr int kYes = 1;
  (void)setsockopt(socket.get(), SOL_SOCKET, SO_PASSCRED, &kYes, sizeof kYes);
  StopLine line(std::move(socket), path);
  if (chmod(path.c_str(), S_IRUSR | S_IWUSR) != 0)
    return std::unexpected("stop line: cannot set the mode of " + path + ": " + errno_text());
  return line;
}

std::optional<OperatorVerb> StopLine::wait() noexcept {
  while (!closed_->load(std::memory_order_acquire)) {
    OperatorMessage message;
    bool is_policys = false;
    const ssize_t size = receive(socket_.get(), message, is_policys);
    // A policy may have the robot stopped, and not dropped.
    if (is_request(message, size)) return is_policys ? OperatorVerb::stop : message.verb;
  }
  return std::nullopt;
}

void StopLine::close() noexcept {
  closed_->store(true, std::memory_order_release);
  shutdown(socket_.get(), SHUT_RD);  // ends a recv() under way, and every later one
}

bool hand_over_stop(const std::string& path, OperatorVerb verb) {
  if (!check_path(path)) return false;
  const Descriptor socket = open_datagram();
  const sockaddr_un address = address_of(path);
  if (!socket.is_open() || connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return false;
  OperatorMessage message;
  message.verb = verb;
  const auto sent = [&] {
    return send(socket.get(), &message, sizeof message, MSG_NOSIGNAL | MSG_DONTWAIT) == sizeof message;
  };
  if (sent()) return true;
  if (errno != EAGAIN) return false;
  pollfd room{socket.get(), POLLOUT, 0};
  poll(&room, 1, kQueueDrainsWithinMs);
  return sent();
}

}  // namespace takt::ipc
