// SPDX-License-Identifier: Apache-2.0
// The report as one HTML file that needs no network: what a reviewer opens (docs/report.md).
#pragma once

#include <optional>
#include <string>

#include "evidence/review/report/run_comparison.hpp"
#include "evidence/review/report/run_series.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"

namespace takt::evidence {

struct ReportContent {
  const monitor::RecordedRun& run;
  const monitor::RunMetrics& metrics;
  const monitor::FaultSummary& faults;
  const RunSeries& series;
  const std::optional<RunComparison>& comparison;
};
std::string report_html(const ReportContent& content);

}  // namespace takt::evidence
