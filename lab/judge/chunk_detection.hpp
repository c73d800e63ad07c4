// SPDX-License-Identifier: Apache-2.0
// Thresholds for chunk monitors from what is usual, and what they and the bare scores find in rollouts that neither
// saw.
//
// Calibration is split conformal: of n levels (monitor/judge/chunk_monitors.hpp) of stretches without a fault, the
// threshold is the ceil((n + 1) (1 - a))-th smallest. Another such stretch exceeds it with a probability of at most a,
// whatever the levels' distribution, as long as the stretches are exchangeable: same robot, task and length. Several
// scores share the rate of alarms evenly, so that together they keep it.
//
// Pure. Errors are one sentence.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/rollout_row.hpp"
#include "monitor/judge/chunk_scores.hpp"

namespace takt::lab {

// `alarms`: share of usual stretches that may have a catch, 0 to 1, all of `scores` together.
std::expected<std::vector<config::ChunkThreshold>, std::string> calibrate(std::span<const monitor::ChunkScores> usual,
                                                                          std::span<const config::ChunkScore> scores,
                                                                          double alarms);

// Area under the receiver operating characteristic: the probability that a failed rollout's value is larger than a
// successful one's, ties counted half; 95 % interval after Hanley and McNeil (1982). Empty: one of the two kinds is
// missing.
struct Auroc {
  double area = 0, low = 0, high = 0;
};
std::optional<Auroc> auroc_of(std::span<const double> failed, std::span<const double> successful);

// One method on one task. Rollouts of the first half of the seeds calibrate (nominal ones that succeeded), the others
// are judged.
struct ChunkDetection {
  std::string task, method;
  config::ChunkMonitors rule;                                        // its votes, and the thresholds
  std::size_t calibrated_on = 0;                                     // rollouts
  std::array<std::optional<Auroc>, config::kChunkScoreCount> auroc;  // of held-out rollouts, in the order of ChunkScore
  std::size_t failed = 0, successful = 0;                            // held-out rollouts
  std::size_t failed_caught = 0;                                     // by any threshold
  std::size_t nominal = 0, nominal_caught = 0;                       // held-out rollouts: false alarms
};
std::expected<ChunkDetection, std::string> detection_of(std::span<const evidence::RolloutRow> rows_of_one_method,
                                                        std::span<const config::ChunkScore> scores, double alarms);
std::string detection_text(const ChunkDetection& detection);

}  // namespace takt::lab
