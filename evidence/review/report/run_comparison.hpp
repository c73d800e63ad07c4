// SPDX-License-Identifier: Apache-2.0
// A run beside an earlier one: the numbers a reviewer compares, and their differences.
//
// The other run's numbers are those of its metrics.json when that belongs to it, else computed from its ticks. Nothing
// is tested for significance: two runs are two runs; `takt compare` judges panels. Errors are one sentence.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "monitor/record/recorded_run.hpp"

namespace takt::evidence {

struct ComparisonRow {
  std::string label, unit;
  std::optional<double> other, here;  // none: nothing of the kind was measured, or an older metrics.json lacks it
};
struct RunComparison {
  std::string other_id, other_path, other_started;
  bool same_contract = true;  // if not, a miss is not the same thing in both
  std::vector<ComparisonRow> rows;
};

// `metrics`: to_json of the run's own.
std::expected<RunComparison, std::string> compare_with(const nlohmann::ordered_json& metrics,
                                                       const std::string& other_path);

std::string comparison_text(const RunComparison& comparison);
nlohmann::ordered_json to_json(const RunComparison& comparison);

}  // namespace takt::evidence
