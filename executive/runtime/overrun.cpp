// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/overrun.hpp"

namespace takt::runtime {
namespace {

constexpr std::int64_t kMinorFaultsThatExplain = 100;
// Receiving, decoding and recording one frame, generously: 2 to 5 us in a virtual machine.
constexpr Duration kFrameCost = microseconds(10);

// a >= share * b, in integers: share = percent / 100.
constexpr bool at_least(Duration a, std::int64_t percent, Duration b) noexcept {
  return a.ns * 100 >= b.ns * percent;
}

bool was_preempted(const MissedPeriod& missed) noexcept {
  const Duration waited = missed.spent.run_delay;
  if (missed.lateness > missed.work) return at_least(waited, 50, missed.lateness);
  return waited.ns * 100 > missed.work.ns * 30;
}

bool worked_too_long(const MissedPeriod& missed) noexcept {
  if (!at_least(missed.spent.cpu - missed.spin, 50, missed.lateness + missed.work)) return false;
  const Duration counted = kFrameCost * static_cast<std::int64_t>(missed.frames_received);
  return missed.follows_long_tick || at_least(counted, 50, missed.work);
}

}  // namespace

OverrunCause attribute(const MissedPeriod& missed) noexcept {
  const Evidence& spent = missed.spent;
  if (spent.voluntary_switches > (missed.slept ? 1 : 0)) return OverrunCause::blocked;
  if (was_preempted(missed)) return OverrunCause::preempted;
  if (spent.major_faults > 0 || spent.minor_faults >= kMinorFaultsThatExplain) return OverrunCause::page_fault;
  if (worked_too_long(missed)) return OverrunCause::own_overrun;
  return OverrunCause::platform_stall;
}

}  // namespace takt::runtime
