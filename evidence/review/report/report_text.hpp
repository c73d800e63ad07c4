// SPDX-License-Identifier: Apache-2.0
// The freshness report of a run for a terminal.
#pragma once

#include <cstddef>
#include <string>

#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"

namespace takt::evidence {

// What the verdict per command and the verdict per tick mean together, in one sentence; empty: nothing to judge.
std::string contract_text(const monitor::RunMetrics& metrics);

// Tables: age by stage, deadline misses against the contract, modes, transitions, marks, refusals, interventions,
// overruns, losses. `most` transitions and marks are listed, the rest counted.
std::string report_text(const monitor::RunMetrics& metrics, const monitor::RecordedRun& run, std::size_t most = 20);
// fault_text(); of a record that does not reach the run's end, no faults are unknown ones.
std::string faults_of_record(const monitor::RunMetrics& metrics, const monitor::FaultSummary& faults,
                             std::size_t most = 5);

}  // namespace takt::evidence
