// SPDX-License-Identifier: Apache-2.0
// "With max_age 180 ms it would have gone on": what a stop hung on, asked of replay. The ticks recorded around an
// incident go through the decision again, with another value of the configuration key that governs its cause, and the
// smallest value is sought with which the rule does not fire before what it waits for is there: a usable command, a
// joint that is heard, a share that falls.
//
// What replay cannot say: how the robot would have moved. From the changed decision on its joints and buses are as they
// were recorded, with the robot stopped. So nothing is said of causes whose measure the stop itself changes (envelope,
// a drive's own fault), nor where the recording has a gap, was altered, or ends before what the rule waits for.
//
// Cost: one more reading of the recording; per incident at most kMostTicks ticks, decided about eight times per key.
#pragma once

#include <cstddef>
#include <vector>

#include "executive/incident/incident.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::evidence {

inline constexpr Duration kReplayedBefore = seconds(5);  // at least, unless the recording begins later
inline constexpr Duration kReplayedBehind = seconds(10);
inline constexpr std::size_t kMostTicks = 40'000;     // of one incident
inline constexpr std::size_t kMostAnswered = 5;       // incidents, faults first
inline constexpr std::int64_t kLargestMultiple = 10;  // of the configured value that is tried

// Fills in `counterfactual` where there is something to say.
void add_counterfactuals(std::vector<incident::Incident>& incidents, const monitor::RecordedRun& run);

}  // namespace takt::evidence
