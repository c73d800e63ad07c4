// SPDX-License-Identifier: Apache-2.0
// One controller per CAN interface: a process that sends on it holds this claim, whatever its runtime directory.
//
// A name in the kernel's abstract socket namespace, made of the interface's index. Like interfaces, such names belong
// to a network namespace: two containers with an interface of the same index each do not meet. It needs no file and no
// rights, and the kernel takes it back when its holder ends, however. An embedded loopback bus needs none: its hub lies
// in a runtime directory, which one executive has. Set-up only; any thread.
#pragma once

#include <expected>
#include <string>

#include "drivers/bus/file_handle.hpp"

namespace takt::drivers {

class InterfaceClaim {
 public:
  // The error is one sentence that names the interface and its holder. Precondition: the interface exists.
  static std::expected<InterfaceClaim, std::string> make(const std::string& interface);

 private:
  explicit InterfaceClaim(FileHandle socket) : socket_(std::move(socket)) {}
  FileHandle socket_;
};

}  // namespace takt::drivers
