// SPDX-License-Identifier: Apache-2.0
// What is usual in a run's answers: the levels (chunk_monitors.hpp) of its stretches of equal length in which the robot
// followed the run's own policy without a break, not another that took charge. What is left over at the end of such a
// time is dropped.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "monitor/judge/chunk_monitors.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::evidence {

// The error is one sentence: the run cannot be read.
std::expected<std::vector<monitor::ChunkScores>, std::string> usual_stretches(const monitor::RecordedRun& run,
                                                                              Duration length);

}  // namespace takt::evidence
