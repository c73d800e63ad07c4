// SPDX-License-Identifier: Apache-2.0
// When to look into the observation mailbox again. The executive wakes no process, so the host sleeps until the next
// observation must be there and then looks at short intervals, rarely once it is long overdue. Never a busy wait.
// Pure. Source of the margin: a tick publishes at its end, tens of microseconds after its stamp.
#pragma once

#include <algorithm>
#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt::policy_host {

inline constexpr Duration kPublishMargin = microseconds(150);
inline constexpr Duration kShortPoll = microseconds(250);  // while the next observation is at most a period late
inline constexpr Duration kLongPoll = milliseconds(2);     // later, or before the first

// `published_at`: of the newest observation read, unset before the first. The answer is in (now, now + 2 periods] or
// within a long poll of now, or `now` itself when the next observation should already be there unseen.
constexpr MonoTime next_look(MonoTime now, MonoTime published_at, Duration period, bool looked_since_due) {
  if (!published_at.is_set()) return now + kLongPoll;
  const MonoTime due = published_at + period + kPublishMargin;
  if (now < due) return std::min(due, now + period * 2);
  if (!looked_since_due) return now;
  return now + (now - due < period ? kShortPoll : kLongPoll);
}

// With several requests in flight: when the next may begin, so that answers come evenly and not in bursts. Requests are
// as far apart as their number brings an inference of ordinary length to end in time for the one after.
class RequestPacing {
 public:
  explicit RequestPacing(std::uint32_t requests) : requests_(requests) {}
  void asked(MonoTime at) { asked_ = at; }
  void took(Duration inference) {
    usual_ = usual_ == Duration{} ? inference : Duration{usual_.ns + (inference.ns - usual_.ns) / kSmoothing};
  }
  // Unset: at any time.
  [[nodiscard]] MonoTime next() const {
    return requests_ == 1 || !asked_.is_set() ? MonoTime{} : asked_ + Duration{usual_.ns / requests_};
  }

 private:
  static constexpr std::int64_t kSmoothing = 8;
  std::uint32_t requests_;
  MonoTime asked_;
  Duration usual_;  // moving average; 0: none has ended
};

}  // namespace takt::policy_host
