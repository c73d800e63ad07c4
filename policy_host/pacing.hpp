// When to look into the observation mailbox again. The executive wakes nobody, so the host sleeps until the next
// observation must be there and then looks at short intervals, rarely once it is long overdue. Never a busy wait.
// Pure. Source of the margin: a tick publishes at its end, tens of microseconds after its stamp.
#pragma once

#include <algorithm>

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

}  // namespace takt::policy_host
