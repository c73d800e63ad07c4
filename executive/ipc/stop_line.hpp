// SPDX-License-Identifier: Apache-2.0
// The stop's own way into the executive: a datagram socket (stop.sock) beside the one where clients meet. It has no
// connection, no greeting, no lease and no answer, so no process can occupy it and nothing has to be waited for: one
// message, one word. Only our own user and root may write to it: the file's mode says so.
//
// An answer comes over the ordinary socket (ipc::ask), when the executive has time for one.
// Thread rules: a line belongs to one thread, but for close(). No allocation or lock in wait().
#pragma once

#include <atomic>
#include <expected>
#include <memory>
#include <optional>
#include <string>

#include "executive/contract/session.hpp"
#include "executive/ipc/descriptor.hpp"

namespace takt::ipc {

// stop, press_stop or deenergise.
constexpr bool is_stop(OperatorVerb verb) {
  switch (verb) {
    case OperatorVerb::stop:
    case OperatorVerb::press_stop:
    case OperatorVerb::deenergise:
      return true;
    case OperatorVerb::status:
    case OperatorVerb::arm:
    case OperatorVerb::reset:
    case OperatorVerb::mark:
    case OperatorVerb::swap:
    case OperatorVerb::back:
      return false;
  }
  return false;
}

// Beside `executive_socket`, in the same directory.
std::string stop_socket_beside(const std::string& executive_socket);

class StopLine {
 public:
  // Precondition: the caller holds the executive's socket in the same directory (SocketClaim), so that whatever lies at
  // `path` belongs to a predecessor that has ended.
  static std::expected<StopLine, std::string> listen(const std::string& path);
  StopLine(StopLine&&) noexcept = default;
  StopLine& operator=(StopLine&&) noexcept = delete;
  ~StopLine();  // unlinks the path

  // Waits for the next request; what is none is passed over. Nothing: closed.
  std::optional<OperatorVerb> wait() noexcept;
  // Ends a wait() from another thread.
  void close() noexcept;

 private:
  StopLine(Descriptor socket, std::string path);
  Descriptor socket_;
  std::string path_;
  std::unique_ptr<std::atomic<bool>> closed_ = std::make_unique<std::atomic<bool>>(false);
};

// Hands a stop to the executive that listens at `path`; waits only where as many as the kernel queues were not read
// yet, and not long. False: no process listens there, or we may not ask (errno).
bool hand_over_stop(const std::string& path, OperatorVerb verb);

}  // namespace takt::ipc
