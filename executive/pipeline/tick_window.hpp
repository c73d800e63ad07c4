// SPDX-License-Identifier: Apache-2.0
// Exact count of marked ticks among the last `length` ticks: a ring of bits, no allocation, constant time per tick.
//
// Before `length` ticks have been seen the count is over those seen so far. Range: length 1..kMaxWindowTicks, the same
// at every call.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

class TickWindow {
 public:
  void push(bool marked, std::uint32_t length) {
    std::uint64_t& word = words_[position_ / 64];
    const std::uint64_t bit = std::uint64_t{1} << (position_ % 64);
    if (seen_ < length) {
      ++seen_;
    } else if ((word & bit) != 0) {
      --count_;
    }
    word = marked ? word | bit : word & ~bit;
    count_ += marked ? 1U : 0U;
    position_ = position_ + 1 == length ? 0 : position_ + 1;
  }

  // `count` marked ticks in a row; no more of them than the window holds make a difference.
  void push_marked(std::uint64_t count, std::uint32_t length) {
    for (std::uint64_t left = std::min<std::uint64_t>(count, length); left != 0; --left) push(true, length);
  }

  void restart() { position_ = seen_ = count_ = 0; }

  [[nodiscard]] std::uint32_t count() const { return count_; }
  [[nodiscard]] std::uint32_t seen() const { return seen_; }

  // What keyframes carry: three counters, then the words that a window of `length` uses.
  static constexpr std::size_t saved_bytes(std::uint32_t length) { return 16 + 8 * ((std::size_t{length} + 63) / 64); }
  // A loaded window is believed only when its counters can have come from `length`.
  [[nodiscard]] bool fits(std::uint32_t length) const {
    return position_ < length && seen_ <= length && count_ <= seen_;
  }

 private:
  std::uint32_t position_ = 0;
  std::uint32_t seen_ = 0;
  std::uint32_t count_ = 0;
  [[maybe_unused]] std::uint32_t reserved_ = 0;
  std::array<std::uint64_t, kMaxWindowTicks / 64> words_{};
};
static_assert(sizeof(TickWindow) == TickWindow::saved_bytes(kMaxWindowTicks));

}  // namespace takt::pipeline
