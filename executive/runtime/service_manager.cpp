// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/service_manager.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <string_view>

namespace takt::runtime {
namespace {

std::string_view environment(const char* name) {
  // This process never changes its environment. NOLINTNEXTLINE(concurrency-mt-unsafe)
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : value;
}

std::int64_t number_in(const char* name) {
  const std::string_view text = environment(name);
  std::int64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

}  // namespace

ServiceManager::ServiceManager() {
  const std::string_view path = environment("NOTIFY_SOCKET");
  if (path.size() < 2 || path.size() > sizeof address_.sun_path) return;
  address_.sun_family = AF_UNIX;
  path.copy(address_.sun_path, path.size());
  if (path.front() == '@') address_.sun_path[0] = '\0';  // abstract
  address_size_ = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
  socket_ = ipc::Descriptor(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const std::int64_t for_pid = number_in("WATCHDOG_PID");
  if (for_pid == 0 || for_pid == getpid()) watchdog_ = microseconds(number_in("WATCHDOG_USEC"));
}

bool ServiceManager::tell(const std::string& message) const {
  if (address_size_ == 0) return true;
  const auto* const address = reinterpret_cast<const sockaddr*>(&address_);
  return sendto(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL, address, address_size_) >= 0;
}

bool ServiceManager::report(MonoTime now, std::uint64_t ticks, const std::string& status) {
  ping(now, ticks);
  if (status != status_ && tell("STATUS=" + status)) status_ = status;
  if (ready_ || ticks < kTicksUntilReady) return false;
  ready_ = tell("READY=1");
  return ready_;
}

void ServiceManager::ping(MonoTime now, std::uint64_t ticks) {
  if (watchdog_.ns == 0 || ticks == pinged_ticks_) return;
  if (pinged_at_.is_set() && (now - pinged_at_) * 3 < watchdog_) return;
  if (!tell("WATCHDOG=1")) return;
  pinged_at_ = now;
  pinged_ticks_ = ticks;
}

void ServiceManager::stopping() const {
  tell("STOPPING=1");
}

}  // namespace takt::runtime
