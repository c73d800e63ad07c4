// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/unix_socket.hpp"

#include <pwd.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace takt::ipc {
namespace {

constexpr std::size_t kMaxDescriptorsPerMessage = 8;
constexpr int kBacklog = 16;

union ControlBuffer {
  cmsghdr aligned;
  std::array<char, CMSG_SPACE(sizeof(int) * kMaxDescriptorsPerMessage)> bytes;
};

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  return address;
}

void collect_descriptors(msghdr& message, std::vector<Descriptor>& into) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr; part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_RIGHTS) continue;
    for (std::size_t at = CMSG_LEN(0); at + sizeof(int) <= part->cmsg_len; at += sizeof(int)) {
      int fd = -1;
      std::memcpy(&fd, reinterpret_cast<const char*>(part) + at, sizeof fd);
      into.emplace_back(fd);
    }
  }
}

}  // namespace

std::string errno_text() {
  return std::generic_category().message(errno);
}

std::expected<void, std::string> check_path(const std::string& path) {
  constexpr std::size_t kLimit = sizeof(sockaddr_un::sun_path) - 1;
  if (path.empty() || path.size() > kLimit) {
    return std::unexpected("rendezvous: socket path \"" + path + "\" has " + std::to_string(path.size()) +
                           " bytes, allowed are 1 to " + std::to_string(kLimit) + ": choose a shorter --runtime-dir");
  }
  return {};
}

Descriptor open_seqpacket(int flags) {
  return Descriptor(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | flags, 0));
}

std::expected<Descriptor, std::string> listen_at(const std::string& path) {
  Descriptor listener = open_seqpacket(SOCK_NONBLOCK);
  const sockaddr_un address = address_of(path);
  if (!listener.is_open() || bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      listen(listener.get(), kBacklog) != 0) {
    return std::unexpected("rendezvous: cannot listen at " + path + ": " + errno_text());
  }
  return listener;
}

bool connect_to(const Descriptor& socket, const std::string& path) {
  const sockaddr_un address = address_of(path);
  return connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

bool may_listen(const std::string& path) {
  if (!check_path(path)) return false;  // no socket has such a path
  const Descriptor socket = open_seqpacket(SOCK_NONBLOCK);
  if (!socket.is_open() || connect_to(socket, path)) return true;
  return errno != ENOENT && errno != ECONNREFUSED && errno != ENOTDIR;
}

Credentials peer_of(int socket) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return {};
  return {credentials.pid, credentials.uid};
}

std::expected<uid_t, std::string> user_id(const std::string& user) {
  std::array<char, 4096> room{};
  passwd entry{};
  passwd* found = nullptr;
  if (getpwnam_r(user.c_str(), &entry, room.data(), room.size(), &found) != 0 || found == nullptr)
    return std::unexpected("this machine has no user `" + user + "`: name one of `getent passwd`");
  return entry.pw_uid;
}

bool send_message(int socket, std::span<const std::byte> message, std::span<const int> descriptors) {
  iovec piece{const_cast<std::byte*>(message.data()), message.size()};
  ControlBuffer control{};
  msghdr header{};
  header.msg_iov = &piece;
  header.msg_iovlen = 1;
  if (!descriptors.empty()) {
    if (descriptors.size() > kMaxDescriptorsPerMessage) {
      errno = E2BIG;
      return false;
    }
    header.msg_control = control.bytes.data();
    header.msg_controllen = CMSG_SPACE(descriptors.size_bytes());
    cmsghdr* const part = CMSG_FIRSTHDR(&header);
    part->cmsg_level = SOL_SOCKET;
    part->cmsg_type = SCM_RIGHTS;
    part->cmsg_len = CMSG_LEN(descriptors.size_bytes());
    std::memcpy(CMSG_DATA(part), descriptors.data(), descriptors.size_bytes());
  }
  ssize_t sent = 0;
  do {
    sent = sendmsg(socket, &header, MSG_NOSIGNAL);
  } while (sent < 0 && errno == EINTR);
  return sent == static_cast<ssize_t>(message.size());
}

Received receive_message(int socket, std::span<std::byte> into, int flags) {
  iovec piece{into.data(), into.size()};
  ControlBuffer control{};
  msghdr header{};
  header.msg_iov = &piece;
  header.msg_iovlen = 1;
  header.msg_control = control.bytes.data();
  header.msg_controllen = control.bytes.size();
  Received received;
  received.size = recvmsg(socket, &header, flags | MSG_TRUNC | MSG_CMSG_CLOEXEC);
  if (received.size >= 0) collect_descriptors(header, received.descriptors);
  return received;
}

}  // namespace takt::ipc
