// SPDX-License-Identifier: Apache-2.0
// What a person, or a signal, asks of the control thread. De-energising wins over everything; a stop is never lost and
// never delayed by an earlier request: each kind has a slot of its own, and discards arm, reset, swap and back, of
// which the newest counts, when they are pending with it. A shutdown is repeated every tick from the moment it is asked
// for; a press of the stop is heard beside it. A mark waits for a tick without another request. Stops and shutdown
// carry the instant at which they were heard.
//
// Thread rules: take() control thread, the others any thread. Lock-free.
#pragma once

#include <atomic>
#include <cstdint>

#include "executive/contract/tick_record.hpp"

namespace takt::runtime {

class OperatorInbox {
 public:
  struct Asked {
    OperatorRequest request = OperatorRequest::none;
    MonoTime at;               // unset but for stops and shutdown
    std::uint64_t policy = 0;  // of a swap: hash of the policy that is to play
  };

  void arm() noexcept { pending_.store(OperatorRequest::arm, std::memory_order_release); }
  void reset() noexcept { pending_.store(OperatorRequest::reset, std::memory_order_release); }
  void swap(std::uint64_t policy) noexcept {
    policy_.store(policy, std::memory_order_relaxed);
    pending_.store(OperatorRequest::swap, std::memory_order_release);
  }
  void back() noexcept { pending_.store(OperatorRequest::back, std::memory_order_release); }
  void mark() noexcept { mark_.store(true, std::memory_order_release); }
  void stop(MonoTime now) noexcept { stop_.ask(now); }
  void press_stop(MonoTime now) noexcept { press_.ask(now); }
  void deenergise(MonoTime now) noexcept { deenergise_.ask(now); }
  void shut_down(MonoTime now) noexcept { shutdown_.ask(now); }

  // This tick's request.
  Asked take() noexcept {
    if (const MonoTime at = take_stop(deenergise_); at.is_set()) return {OperatorRequest::deenergise, at};
    if (const MonoTime at = take_stop(press_); at.is_set()) return {OperatorRequest::press_stop, at};
    if (const MonoTime at = shutdown_.asked_at(); at.is_set()) return {OperatorRequest::shutdown, at};
    if (const MonoTime at = take_stop(stop_); at.is_set()) return {OperatorRequest::stop, at};
    const OperatorRequest asked = pending_.exchange(OperatorRequest::none, std::memory_order_acq_rel);
    if (asked == OperatorRequest::swap) return {asked, {}, policy_.load(std::memory_order_relaxed)};
    if (asked != OperatorRequest::none || !mark_.exchange(false, std::memory_order_acq_rel)) return {asked, {}};
    return {OperatorRequest::mark, {}};
  }

 private:
  // The first of several counts.
  class Slot {
   public:
    void ask(MonoTime now) noexcept {
      std::int64_t none = 0;
      ns_.compare_exchange_strong(none, now.ns, std::memory_order_acq_rel);
    }
    MonoTime take() noexcept { return MonoTime{ns_.exchange(0, std::memory_order_acq_rel)}; }
    [[nodiscard]] MonoTime asked_at() const noexcept { return MonoTime{ns_.load(std::memory_order_acquire)}; }

   private:
    std::atomic<std::int64_t> ns_ = 0;  // 0: nothing asked
    static_assert(std::atomic<std::int64_t>::is_always_lock_free);
  };

  MonoTime take_stop(Slot& slot) noexcept {
    const MonoTime at = slot.take();
    if (at.is_set()) pending_.store(OperatorRequest::none, std::memory_order_relaxed);
    return at;
  }

  std::atomic<OperatorRequest> pending_ = OperatorRequest::none;
  std::atomic<std::uint64_t> policy_ = 0;
  std::atomic<bool> mark_ = false;
  Slot stop_, press_, deenergise_, shutdown_;
  static_assert(std::atomic<OperatorRequest>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);
};

}  // namespace takt::runtime
