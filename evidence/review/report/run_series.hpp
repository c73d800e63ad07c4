// SPDX-License-Identifier: Apache-2.0
// What the HTML report draws of a run, in two levels of detail: `whole` covers the run in buckets of equal size, as
// fine as the page's weight allows; `moments` holds every tick around the beginning of each fault verdict, for runs too
// long to hold every tick. Both together are at most kWholeBytes + kMomentBytes, however long the run was; so is what
// the policies saw (shown_images.hpp). Streamed: memory is the series plus one tick. Errors are one sentence.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "evidence/review/report/sample_block.hpp"
#include "evidence/review/report/shown_images.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"

namespace takt::evidence {

// Base64 makes three bytes four, even if nothing could be compressed: with script and tables below 15 MB, with images
// below 21.
inline constexpr std::size_t kWholeBytes = 8'500'000;
inline constexpr std::size_t kMomentBytes = 1'800'000;
inline constexpr std::size_t kListedBands = 5'000;

// A stretch of time in one mode.
struct ModeBand {
  double from_s = 0, to_s = 0;
  Mode mode = Mode::standby;
  Cause left_by = Cause::none;  // none: the run ended in it
};

struct RunSeries {
  SampleBlock whole, moments;
  std::vector<ModeBand> modes;  // the first kListedBands
  std::vector<SeenBySensor> seen;
};

// `truth_file`: takt-plant's record of what the simulated robot did (simulation/truth_log.hpp), for the task's
// target; empty: none. `whole_bytes` as kWholeBytes, smaller in tests.
std::expected<RunSeries, std::string> series_of(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics,
                                                const monitor::FaultSummary& faults, const std::string& truth_file,
                                                std::size_t whole_bytes = kWholeBytes);

}  // namespace takt::evidence
