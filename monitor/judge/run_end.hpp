// SPDX-License-Identifier: Apache-2.0
// Does the record reach the run's end, and what is known of the run where it does not? "None" is said of a whole record
// only: a robot may have stopped behind the last tick that can be read.
#pragma once

#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::monitor {

// Once the ticks are counted and the incidents noted. Fills in `record_gap`; where it is not empty, joins the stops and
// transitions that transitions.jsonl and the executive's log tell of and the ticks do not, and what was held is
// undecided. Then what events.jsonl explains: `stop_origins`, and the sentences of the incidents.
void judge_end(RunMetrics& metrics, const RecordedRun& run);

}  // namespace takt::monitor
