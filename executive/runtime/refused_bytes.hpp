// SPDX-License-Identifier: Apache-2.0
// How much of what is refused may be recorded whole: so many bytes at once, so many per tick on average. Beyond that a
// message leaves its header, its size and its checksum, which is what replay needs of it. Without this a policy that
// sends nothing but refused messages decides what is left of a run. Thread rule: control thread.
#pragma once

#include <algorithm>
#include <cstddef>

namespace takt::runtime {

inline constexpr std::size_t kRefusedBytesAtOnce = std::size_t{64} << 10U;
inline constexpr std::size_t kRefusedBytesPerTick = 64;

class RefusedBytes {
 public:
  // Once per tick.
  void next_tick() noexcept { left_ = std::min(left_ + kRefusedBytesPerTick, kRefusedBytesAtOnce); }
  // True: as many may be recorded, and are counted.
  bool take(std::size_t bytes) noexcept {
    if (bytes > left_) return false;
    left_ -= bytes;
    return true;
  }

 private:
  std::size_t left_ = kRefusedBytesAtOnce;
};

}  // namespace takt::runtime
