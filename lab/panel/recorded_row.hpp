// SPDX-License-Identifier: Apache-2.0
// The row of a rollout that real processes lived through: the same measures as in virtual time, from the run folder's
// recorded ticks and from what takt-plant wrote that the robot really did.
//
// The rollout begins with the first tick in tracking and ends `duration` later; what was recorded before (start-up,
// arming) and after (the stop at the end) does not count. Between two entries of the truth file the earlier one holds.
#pragma once

#include <expected>
#include <string>

#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/rollout.hpp"
#include "evidence/rollout/rollout_row.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

struct RecordedRollout {
  std::string run_folder;
  std::string truth_file;  // takt-plant --truth
  evidence::Task task = evidence::Task::arm_tracking;
  evidence::Perturbation perturbation;
  Duration duration, scored;
  double bound_m = 0;
};

// Of a planned rollout whose processes lived in `folder`: its run/ and truth.jsonl.
RecordedRollout recorded_rollout(const Panel& panel, const PlannedRollout& planned, const std::string& folder);

// Fills everything of the row but its identity, verdicts and host fields; `watch` sees the rollout's commands and
// ticks. The error is one sentence: the recording is unreadable, or shorter than the rollout.
std::expected<void, std::string> measure_recorded(const RecordedRollout& rollout, RolloutWatch& watch,
                                                  evidence::RolloutRow& row);

}  // namespace takt::lab
