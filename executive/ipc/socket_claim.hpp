// SPDX-License-Identifier: Apache-2.0
// Taking possession of a socket path: the directory is made, a dead predecessor's socket is replaced, a live one is
// respected. Two servers that start at once cannot both win: `.lock` in the directory, which its owner alone may open,
// is locked while one of them looks and binds. Thread rule: set-up only.
#pragma once

#include <sys/types.h>

#include <expected>
#include <string>
#include <utility>

#include "executive/ipc/descriptor.hpp"

namespace takt::ipc {

class SocketClaim {
 public:
  // `owner` is given the socket (mode 0660) and a directory made here (mode 0750) when it is not our own user.
  static std::expected<SocketClaim, std::string> make(const std::string& path, uid_t owner);
  SocketClaim(SocketClaim&&) noexcept = default;
  ~SocketClaim();  // unlinks the path, unless a successor has replaced the socket meanwhile
  [[nodiscard]] int listener() const { return listener_.get(); }
  // False: the socket was removed, or its directory, or another lies in its place: no process finds it any more.
  [[nodiscard]] bool has_name() const;

 private:
  SocketClaim(Descriptor listener, std::string path, dev_t device, ino_t inode)
      : listener_(std::move(listener)), path_(std::move(path)), device_(device), inode_(inode) {}
  Descriptor listener_;
  std::string path_;
  dev_t device_;
  ino_t inode_;
};

}  // namespace takt::ipc
