// SPDX-License-Identifier: Apache-2.0
// How far the run has reached the recorder's medium, as the monitor last said; 0: no recorder. The tick judges it.
// Thread rules: set() service thread, get() control thread. Lock-free.
#pragma once

#include <atomic>
#include <cstdint>

namespace takt::runtime {

class RecordedThrough {
 public:
  void set(std::uint64_t tick) noexcept { tick_.store(tick, std::memory_order_release); }
  [[nodiscard]] std::uint64_t get() const noexcept { return tick_.load(std::memory_order_acquire); }

 private:
  std::atomic<std::uint64_t> tick_ = 0;
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
};

}  // namespace takt::runtime
