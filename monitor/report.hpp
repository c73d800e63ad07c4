// The freshness report of a run, for a terminal and as one HTML file that needs no network.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "monitor/run_metrics.hpp"

namespace takt::monitor {

// Tables: age by stage, deadline misses against the contract, modes, transitions, refusals, interventions, overruns,
// losses. `most_transitions` are listed, the rest counted.
std::string report_text(const RunMetrics& metrics, const RecordedRun& run, std::size_t most_transitions = 20);

// What the HTML report draws, thinned out so that the file stays small however long the run was: each bucket of ticks
// keeps the samples at which the drawn value was smallest and largest.
struct RunSeries {
  struct AgeSample {
    double at_s = 0;
    double total_ms = 0;
  };
  struct StageSample {  // at the bucket's oldest command
    double at_s = 0;
    std::array<double, kAgePartCount - 1> part_ms{};
  };
  struct JointSample {
    double at_s = 0;
    float q = 0, reference = 0;  // rad
  };
  std::uint64_t bucket_ticks = 1;
  std::vector<AgeSample> age;
  std::vector<StageSample> stages;
  std::vector<std::vector<JointSample>> joints;
};
std::expected<RunSeries, std::string> series_of(const RecordedRun& run, const RunMetrics& metrics);

std::string report_html(const RunMetrics& metrics, const RunSeries& series, const RecordedRun& run);

}  // namespace takt::monitor
