// SPDX-License-Identifier: Apache-2.0
// The few operations on SOCK_SEQPACKET Unix sockets that both ends of a rendezvous need.
// Errors are errno's text with the path. Thread rule: service threads only.
#pragma once

#include <sys/types.h>
#include <sys/un.h>

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <vector>

#include "executive/ipc/descriptor.hpp"

namespace takt::ipc {

struct Credentials {
  pid_t pid = 0;
  uid_t uid = 0;
};

// A policy behind its boundary (policy_host/boundary.hpp) is in a user namespace of its own, as is all that it starts.
// unknown: the process has ended, or hides.
enum class UserNamespace : std::uint8_t { ours, another, unknown };
UserNamespace user_namespace_of(pid_t pid) noexcept;

std::string errno_text();

// `path` no longer than check_path() allows.
sockaddr_un address_of(const std::string& path);

// A socket bound to `path` and listening. The caller made sure that the path is free.
std::expected<Descriptor, std::string> listen_at(const std::string& path);
// EAGAIN in errno when the backlog stayed full for the socket's send timeout.
bool connect_to(const Descriptor& socket, const std::string& path);
// False only when the kernel says that no process listens there; a server that may not be asked is there all the same.
bool may_listen(const std::string& path);
Descriptor open_seqpacket(int flags = 0);  // flags: SOCK_NONBLOCK or 0
std::expected<void, std::string> check_path(const std::string& path);
// What the kernel says about the other end (SO_PEERCRED); pid 0 when it says nothing.
Credentials peer_of(int socket);

// Of a user by name; the error is one sentence.
std::expected<uid_t, std::string> user_id(const std::string& user);

// One message with descriptors attached. False: the peer is gone or will not take it (errno says why). Never raises
// SIGPIPE.
bool send_message(int socket, std::span<const std::byte> message, std::span<const int> descriptors);

// One message; `size` is its true size, also when it did not fit; 0: the peer closed. -1: nothing came (errno).
struct Received {
  ssize_t size = -1;
  std::vector<Descriptor> descriptors;
};
Received receive_message(int socket, std::span<std::byte> into, int flags);

}  // namespace takt::ipc
