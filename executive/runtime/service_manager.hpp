// SPDX-License-Identifier: Apache-2.0
// What the service manager is told (sd_notify(3)): ready, alive, what the executive is doing, stopping.
//
// Alive means that ticks advance: a ping is sent only when at least one tick completed since the last ping, so that a
// control thread that hangs, or never got to run, is restarted. Nothing waits: a message the manager's queue has no
// room for is sent again with the next report. Without NOTIFY_SOCKET nothing is sent anywhere. Thread rule: service
// thread.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <cstdint>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "executive/ipc/descriptor.hpp"

namespace takt::runtime {

// Ticks that must have completed before the service counts as started.
inline constexpr std::uint64_t kTicksUntilReady = 100;

class ServiceManager {
 public:
  ServiceManager();  // reads NOTIFY_SOCKET and WATCHDOG_USEC
  // Call it a few times per watchdog period. True when this call reported ready: once.
  bool report(MonoTime now, std::uint64_t ticks, const std::string& status);
  void stopping() const;

 private:
  void ping(MonoTime now, std::uint64_t ticks);
  // True when it was taken, or no manager listens.
  bool tell(const std::string& message) const;

  ipc::Descriptor socket_;
  sockaddr_un address_{};
  socklen_t address_size_ = 0;  // 0: no manager listens
  Duration watchdog_;           // 0: not asked for
  MonoTime pinged_at_;
  std::uint64_t pinged_ticks_ = 0;
  bool ready_ = false;
  std::string status_;
};

}  // namespace takt::runtime
