// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/sent_frames.hpp"

#include <algorithm>

namespace takt::drivers {
namespace {

bool is_same(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.extended == b.extended && a.remote == b.remote && a.length == b.length &&
         (a.remote || std::equal(a.data, a.data + a.length, b.data));
}

}  // namespace

void SentFrames::handed_over(const CanFrame& frame, MonoTime now) noexcept {
  if (count_ == kRoom) {
    has_more_ = true;
    return;
  }
  frames_[(first_ + count_) % kRoom] = {frame, now};
  ++count_;
}

void SentFrames::left(const CanFrame& frame, MonoTime stamp) noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    if (!is_same(at(i).frame, frame)) continue;
    drop(i + 1);
    left_at_ = std::max(left_at_, stamp);
    return;
  }
  if (!has_more_) return;
  forget();
  left_at_ = std::max(left_at_, stamp);
}

void SentFrames::forget() noexcept {
  count_ = 0;
  has_more_ = false;
}

void SentFrames::drop(std::size_t frames) noexcept {
  first_ = (first_ + frames) % kRoom;
  count_ -= frames;
  if (count_ == 0) has_more_ = false;
}

}  // namespace takt::drivers
