// SPDX-License-Identifier: Apache-2.0
// The stranger's end of a socket, played in a thread while the reader under test talks to it.
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <string>
#include <thread>
#include <utility>

#include "executive/ipc/descriptor.hpp"
#include "tests/fuzz/source.hpp"

namespace takt::fuzz {

// A Unix socket of that type (SOCK_SEQPACKET, SOCK_STREAM), anew.
inline ipc::Descriptor listening(const std::string& path, int type) {
  ::unlink(path.c_str());
  ipc::Descriptor socket(::socket(AF_UNIX, type | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  require(::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  require(::listen(socket.get(), 8) == 0);
  return socket;
}

class Peer {
 public:
  // `script` plays one connection and returns: then it is closed.
  Peer(ipc::Descriptor listener, std::function<void(int socket)> script)
      : listener_(std::move(listener)), stop_(::eventfd(0, EFD_CLOEXEC)), script_(std::move(script)) {
    thread_ = std::thread([this] { accept_all(); });
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer() {
    require(::eventfd_write(stop_.get(), 1) == 0);
    thread_.join();
  }

 private:
  void accept_all() const {
    while (true) {
      std::array<pollfd, 2> polled{{{stop_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}}};
      (void)::poll(polled.data(), polled.size(), -1);
      if (polled[1].revents == 0) return;
      const ipc::Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
      const timeval patience{.tv_sec = 2, .tv_usec = 0};
      require(::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) == 0);
      script_(socket.get());
    }
  }

  ipc::Descriptor listener_, stop_;
  std::function<void(int)> script_;
  std::thread thread_;
};

// Waits for what comes next; false: the other end closed.
inline bool hears(int socket) {
  std::array<std::byte, 8192> ignored{};
  return ::recv(socket, ignored.data(), ignored.size(), 0) > 0;
}

}  // namespace takt::fuzz
