// SPDX-License-Identifier: Apache-2.0
// Why a period was missed: a pure function of the evidence around it. The first match wins:
//
//   blocked         the thread gave the core away by itself more often than its one sleep explains
//   preempted       the scheduler let it wait: for more than 0.3 of the working time, or, when the late wake-up was the
//                   larger part, for at least half of that lateness
//   page_fault      a fault that needed the disk, or 100 of the cheap kind (about 0.5 us each)
//   own_overrun     it executed for at least half of the time lost, and that is its own doing: the frames it received
//                   account for half of the work, or the tick before was long as well
//   platform_stall  none of these: the machine stood still (hypervisor, firmware interrupt, late timer)
//
// Executed time alone proves nothing in a virtual machine: time that a hypervisor steals without telling the guest
// looks executed. But a tick's work is bounded and nearly constant, so a single long tick with the usual work is the
// machine's. Limit: the first tick of our own slowness that no count explains is called platform_stall, the next ones
// own_overrun.
#pragma once

#include <cstddef>

#include "executive/contract/overrun.hpp"
#include "executive/runtime/evidence.hpp"

namespace takt::runtime {

struct MissedPeriod {
  Duration lateness;                // woke this long after it was due
  Duration work;                    // from waking until evidence is taken and the loop may sleep
  Duration spin;                    // executed before waking, on purpose (hybrid wake-up)
  bool slept = true;                // one voluntary switch is the sleep itself
  std::size_t frames_received = 0;  // by this tick: the part of its work that varies
  bool follows_long_tick = false;   // the tick before worked for more than half its period
  Evidence spent;                   // from the end of the previous tick to the end of this one
};

OverrunCause attribute(const MissedPeriod& missed) noexcept;

}  // namespace takt::runtime
