// The same-artifact rule, enforced: two methods are compared row by row, and only where the rows were computed by one
// script on one panel, one seed plan, one plant and one row schema.
//
// Rows are pairs when task, perturbation, dose and seed agree. Differences are B - A. What has no number on either side
// (recovery_s of a rollout that never recovered) is left out of that metric and counted. Miss rates of methods with
// different freshness contracts are not compared, because a miss is not the same thing then; a note says so.
#pragma once

#include <cstdint>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "evidence/artifact/artifact.hpp"
#include "evidence/artifact/confusion.hpp"
#include "evidence/judge/paired_statistics.hpp"

namespace takt::panel {

inline constexpr const char* kComparisonSchema = "takt.comparison/1";
inline constexpr std::uint64_t kBootstrapSeed = 552;

struct SuccessTable {
  std::uint64_t both = 0, only_a = 0, only_b = 0, neither = 0;
  double p_value = 1;  // exact McNemar, two-sided
  [[nodiscard]] std::uint64_t pairs() const { return both + only_a + only_b + neither; }
};

struct MetricDifference {
  std::string metric, unit;
  double mean_a = 0, mean_b = 0;  // over the pairs
  MeanDifference difference;      // b - a
  std::uint64_t left_out = 0;     // pairs without a number on both sides
};

struct GroupComparison {
  std::string task, perturbation;  // empty: all together
  double dose = 0;
  SuccessTable success;
  std::vector<MetricDifference> metrics;
};

struct RowPair {
  RolloutRow a, b;
};

struct Side {
  std::string artifact_id;  // "incomplete" when it is
  std::string folder, method;
  std::optional<Confusion> confusion;  // of the method's rollouts; none: no cause was planted in them
  std::uint64_t unpaired = 0;          // rows of the method without a partner
};

struct Comparison {
  Side a, b;
  std::string panel;
  std::vector<RowPair> pairs;  // ordered by task, perturbation, dose, seed
  std::vector<GroupComparison> groups;
  GroupComparison pooled;
  std::vector<std::string> notes;  // what a reader must know before quoting a number
};

// Empty method names stand for an artifact's only method. The error is one sentence: why these must not be compared.
std::expected<Comparison, std::string> compare(const Artifact& a, const Artifact& b, const std::string& method_a = "",
                                               const std::string& method_b = "");

std::string comparison_text(const Comparison& comparison);
// One line per pair: how each side ended, p99 age per tick, tracking error.
std::string comparison_rows_text(const Comparison& comparison);
nlohmann::ordered_json to_json(const Comparison& comparison);
// One file without scripts or requests. Holds the fault classifier's confusion matrices where both sides have one.
std::string comparison_html(const Comparison& comparison);

}  // namespace takt::panel
