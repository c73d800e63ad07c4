// SPDX-License-Identifier: Apache-2.0
// A recorded run's numbers and its faults, from one pass over its ticks; where it stopped, from a second one what would
// have kept it going (counterfactual.hpp); and what other files of the run tell (monitor/judge/run_end.hpp,
// script.hpp). Errors are one sentence.
#pragma once

#include <expected>
#include <string>

#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"

namespace takt::evidence {

struct RunReview {
  monitor::RunMetrics metrics;
  monitor::FaultSummary faults;
};
std::expected<RunReview, std::string> review_of(const monitor::RecordedRun& run);

}  // namespace takt::evidence
