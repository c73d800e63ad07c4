// The freshness report of a run for a terminal.
#pragma once

#include <cstddef>
#include <string>

#include "monitor/judge/run_metrics.hpp"

namespace takt::monitor {

// Tables: age by stage, deadline misses against the contract, modes, transitions, marks, refusals, interventions,
// overruns, losses. `most` transitions and marks are listed, the rest counted.
std::string report_text(const RunMetrics& metrics, const RecordedRun& run, std::size_t most = 20);

}  // namespace takt::monitor
