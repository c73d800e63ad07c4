// SPDX-License-Identifier: Apache-2.0
// Goal: every missed period is blamed on the cause the evidence shows, first match first. Method: a table of evidence
// as it was seen around injected faults, with the values just inside and outside each threshold.
#include "executive/runtime/overrun.hpp"

#include <gtest/gtest.h>

namespace takt::runtime {
namespace {

struct Row {
  const char* when;
  MissedPeriod missed;
  OverrunCause cause;
};

// cpu, run delay (us), voluntary switches, minor faults, major faults
Evidence spent(std::int64_t cpu_us, std::int64_t delay_us, std::int64_t switches = 1, std::int64_t minor = 0,
               std::int64_t major = 0) {
  return {microseconds(cpu_us), microseconds(delay_us), switches, minor, major};
}
MissedPeriod missed(std::int64_t late_us, std::int64_t work_us, const Evidence& evidence) {
  return {microseconds(late_us), microseconds(work_us), {}, true, 6, false, evidence};
}
MissedPeriod after_long_tick(MissedPeriod missed) {
  missed.follows_long_tick = true;
  return missed;
}
MissedPeriod with_frames(std::size_t frames, MissedPeriod missed) {
  missed.frames_received = frames;
  return missed;
}

const Row kRows[] = {
    {"a call slept inside the tick", missed(20, 2000, spent(60, 10, 2)), OverrunCause::blocked},
    {"no sleep was needed, but one voluntary switch happened",
     {microseconds(0), microseconds(2000), {}, false, 6, false, spent(60, 0, 1)},
     OverrunCause::blocked},
    {"no sleep was needed, and none happened",
     {microseconds(0), microseconds(2000), {}, false, 6, false, spent(60, 0, 0)},
     OverrunCause::platform_stall},
    {"blocked and preempted: blocked is named first", missed(20, 2000, spent(60, 1900, 2)), OverrunCause::blocked},
    {"somebody ran for most of the tick", missed(20, 2000, spent(100, 1900)), OverrunCause::preempted},
    {"run delay just above 0.3 of the work", missed(20, 2000, spent(1390, 601)), OverrunCause::preempted},
    {"run delay just at 0.3 of the work", after_long_tick(missed(20, 2000, spent(1400, 600))),
     OverrunCause::own_overrun},
    {"woke late, and waited for the core half of that time", missed(3000, 100, spent(100, 1500)),
     OverrunCause::preempted},
    {"woke late, and hardly waited for the core", missed(3000, 100, spent(100, 1499)), OverrunCause::platform_stall},
    {"preempted while faulting: preempted is named first", missed(20, 2000, spent(100, 1900, 1, 500)),
     OverrunCause::preempted},
    {"a fault that read the disk", missed(20, 2000, spent(100, 0, 1, 0, 1)), OverrunCause::page_fault},
    {"a hundred cheap faults", missed(20, 2000, spent(1900, 0, 1, 100)), OverrunCause::page_fault},
    {"a few cheap faults explain nothing", after_long_tick(missed(20, 2000, spent(1900, 0, 1, 99))),
     OverrunCause::own_overrun},
    {"a flood of frames explains the time", with_frames(128, missed(20, 2000, spent(2010, 10))),
     OverrunCause::own_overrun},
    {"just enough frames to explain half of it", with_frames(100, missed(0, 2000, spent(2000, 0))),
     OverrunCause::own_overrun},
    {"a frame too few", with_frames(99, missed(0, 2000, spent(2000, 0))), OverrunCause::platform_stall},
    {"one long tick with the usual work: stolen time looks executed", missed(20, 2000, spent(2010, 10)),
     OverrunCause::platform_stall},
    {"the tick is long again and again", after_long_tick(missed(20, 2000, spent(2010, 10))), OverrunCause::own_overrun},
    {"it executed for just half of the time lost", after_long_tick(missed(0, 2000, spent(1000, 0))),
     OverrunCause::own_overrun},
    {"it executed for less than half", after_long_tick(missed(0, 2000, spent(999, 0))), OverrunCause::platform_stall},
    {"spinning before the wake-up is no work",
     {microseconds(0), microseconds(2000), microseconds(900), true, 6, true, spent(1500, 0)},
     OverrunCause::platform_stall},
    {"nothing in the guest explains it", missed(20, 2000, spent(60, 10)), OverrunCause::platform_stall},
};

TEST(Overrun, TableOfEvidence) {
  for (const Row& row : kRows) EXPECT_EQ(name(attribute(row.missed)), name(row.cause)) << row.when;
}

}  // namespace
}  // namespace takt::runtime
