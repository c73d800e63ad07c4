// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/unix_socket.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <system_error>

namespace takt::ipc {
namespace {

constexpr std::size_t kMaxDescriptorsPerMessage = 8;
constexpr int kBacklog = 16;

union ControlBuffer {
  cmsghdr aligned;
  std::array<char, CMSG_SPACE(sizeof(int) * kMaxDescriptorsPerMessage)> bytes;
};

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

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  return address;
}

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

namespace {

// What everybody may read of a process's user namespace, without an allocation: the stop line asks too.
struct Visible {
  std::array<char, 512> text{};
  std::size_t size = 0;
  bool operator==(const Visible&) const = default;
  [[nodiscard]] bool denies_setgroups() const noexcept {
    return std::string_view(text.data(), size).ends_with("deny\n");
  }
};

Visible visible_of(const char* process) noexcept {
  Visible visible;
  for (const char* const file : {"uid_map", "setgroups"}) {
    std::array<char, 48> path{};
    std::snprintf(path.data(), path.size(), "/proc/%s/%s", process, file);
    const Descriptor open_file(open(path.data(), O_RDONLY | O_CLOEXEC));
    const ssize_t size = read(open_file.get(), visible.text.data() + visible.size, visible.text.size() - visible.size);
    if (size > 0) visible.size += static_cast<std::size_t>(size);
  }
  return visible;
}

}  // namespace

UserNamespace user_namespace_of(pid_t pid) noexcept {
  std::array<char, 16> process{};
  std::array<char, 32> path{};
  std::snprintf(process.data(), process.size(), "%d", pid);
  std::snprintf(path.data(), path.size(), "/proc/%d/ns/user", pid);
  struct stat ours {
  }, theirs{};
  if (stat("/proc/self/ns/user", &ours) != 0) return UserNamespace::ours;  // a kernel without them, or no /proc
  if (stat(path.data(), &theirs) == 0) {
    const bool same = ours.st_ino == theirs.st_ino && ours.st_dev == theirs.st_dev;
    return same ? UserNamespace::ours : UserNamespace::another;
  }
  // It has rights that we lack, or hides. A boundary's map or setgroups differs from those of a whole machine.
  const Visible visible = visible_of(process.data()), own = visible_of("self");
  if (visible.size == 0) return UserNamespace::unknown;
  if (visible != own) return UserNamespace::another;
  return own.denies_setgroups() ? UserNamespace::unknown : UserNamespace::ours;
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
