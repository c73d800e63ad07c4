// What a person, or a signal, asks of the control thread. A stop is never lost and never delayed by an earlier request:
// it has its own flag, wins over arm and reset, and discards them when they are pending with it. A shutdown is repeated
// every tick from the moment it is asked for. A mark waits for a tick without another request.
//
// Thread rules: take() control thread, the others the service thread. Lock-free.
#pragma once

#include <atomic>

#include "executive/contract/tick_record.hpp"

namespace takt::runtime {

class OperatorInbox {
 public:
  void arm() noexcept { pending_.store(OperatorRequest::arm, std::memory_order_release); }
  void reset() noexcept { pending_.store(OperatorRequest::reset, std::memory_order_release); }
  void stop() noexcept { stop_.store(true, std::memory_order_release); }
  void mark() noexcept { mark_.store(true, std::memory_order_release); }
  void shut_down() noexcept { shutdown_.store(true, std::memory_order_release); }

  // This tick's request.
  OperatorRequest take() noexcept {
    if (shutdown_.load(std::memory_order_acquire)) return OperatorRequest::shutdown;
    if (stop_.exchange(false, std::memory_order_acq_rel)) {
      pending_.store(OperatorRequest::none, std::memory_order_relaxed);
      return OperatorRequest::stop;
    }
    const OperatorRequest asked = pending_.exchange(OperatorRequest::none, std::memory_order_acq_rel);
    if (asked != OperatorRequest::none || !mark_.exchange(false, std::memory_order_acq_rel)) return asked;
    return OperatorRequest::mark;
  }

 private:
  std::atomic<OperatorRequest> pending_ = OperatorRequest::none;
  std::atomic<bool> stop_ = false;
  std::atomic<bool> mark_ = false;
  std::atomic<bool> shutdown_ = false;
  static_assert(std::atomic<OperatorRequest>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);
};

}  // namespace takt::runtime
