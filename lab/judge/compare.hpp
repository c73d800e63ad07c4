// SPDX-License-Identifier: Apache-2.0
// The same-artifact rule, enforced: two methods are compared row by row, and only where the rows were computed by one
// script on one panel, one seed plan, one plant and one row schema.
//
// Rows are pairs when task, perturbation, dose and seed agree. Differences are B - A. What has no value on either side
// (recovery_s of a rollout that never recovered) is left out of that metric and counted. Miss rates of methods with
// different freshness contracts are not compared, because a miss is not the same thing then; a note says so.
#pragma once

#include <cstdint>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lab/artifact/artifact.hpp"
#include "lab/artifact/confusion.hpp"
#include "lab/judge/audit.hpp"
#include "lab/judge/paired_statistics.hpp"

namespace takt::lab {

inline constexpr const char* kComparisonSchema = "takt.comparison/2";

struct SuccessTable {
  std::uint64_t both = 0, only_a = 0, only_b = 0, neither = 0;
  std::uint64_t seeds = 0, seeds_for_a = 0, seeds_for_b = 0;  // all, and those in which one succeeded more often
  double p_value = 1;          // of equal success: sign_flip_p over seeds, exact McNemar where each has one pair
  double evidence = 1;         // against equal success: anytime_evidence over seeds
  double effective_pairs = 0;  // independent pairs that say as much
  [[nodiscard]] std::uint64_t pairs() const { return both + only_a + only_b + neither; }
};

struct MetricDifference {
  std::string metric, unit;
  double mean_a = 0, mean_b = 0;  // over the pairs
  MeanDifference difference;      // b - a; of success with its exact interval
  double b_better = 0;            // share of the pairs, ties half
  double p_value = 1;             // of neither method being better: sign_flip_p
  bool differs = false;           // in any pair
  bool is_clear = false;          // survives Holm's correction over its table
  std::uint64_t left_out = 0;     // pairs without a number on both sides
};

struct GroupComparison {
  std::string task, perturbation;  // empty: all together
  double dose = 0;
  SuccessTable success;
  std::vector<MetricDifference> metrics;
};

struct RowPair {
  evidence::RolloutRow a, b;
};

struct Side {
  std::string artifact_id;  // "incomplete" when it is
  std::string folder, method;
  std::optional<Confusion> confusion;  // of the method's rollouts; none: no cause was planted in them
  std::uint64_t unpaired = 0;          // rows of the method without a partner
};

// What the reader calls no worse.
struct SuccessMargin {
  double width = 0;  // between 0 and 1
  bool with_plan = false;
};

// Of what the panel file gives the two methods; empty: as the robot file has it.
struct ConfigurationDifference {
  std::string key, a, b;
};

struct Comparison {
  Side a, b;
  std::string panel;
  std::vector<RowPair> pairs;  // ordered by task, perturbation, dose, seed
  std::vector<GroupComparison> groups;
  GroupComparison pooled;
  std::optional<SuccessMargin> margin;
  std::vector<std::string> notes;                                     // what a reader must know before quoting a number
  std::optional<std::vector<ConfigurationDifference>> configuration;  // none: the panel file was not asked
};

// Empty method names stand for an artifact's only method. The error is one sentence: why these must not be compared.
std::expected<Comparison, std::string> compare(const Artifact& a, const Artifact& b, const std::string& method_a = "",
                                               const std::string& method_b = "");

// In what the two methods differ, says `promise`, of the panel that both come from; a note where the manifests say
// otherwise.
void name_configuration(const Artifact& a, const Artifact& b, const PanelPromise& promise, Comparison& comparison);

// How B's success over all pairs stands to A's.
enum class MarginVerdict : std::uint8_t {
  superior,      // the interval lies above 0
  non_inferior,  // above -margin
  inferior,      // below -margin
  undecided,
};
// `margin` between 0 and 1.
MarginVerdict margin_verdict(const Comparison& comparison, double margin);
std::string_view name(MarginVerdict verdict);
// Pairs after which the interval lies above -margin with a probability of 90 %, if both methods succeed equally often
// and as many pairs differ as seen. Simulated, the probability is 90 to 91 %. Source: Nam 1997, Establishing
// equivalence of two treatments and sample size requirements in matched-pairs design.
std::uint64_t pairs_to_decide(const Comparison& comparison, double margin);

// Sentences that text and HTML share.
std::string success_text(const SuccessTable& success);
std::string any_look_text(const SuccessTable& success);
std::string margin_text(const Comparison& comparison, const SuccessMargin& margin);

std::string comparison_text(const Comparison& comparison);
// One line per pair: how each side ended, p99 age per tick, tracking error.
std::string comparison_rows_text(const Comparison& comparison);
nlohmann::ordered_json to_json(const Comparison& comparison);
// One file without scripts or requests. Holds the fault classifier's confusion matrices where both sides have one.
std::string comparison_html(const Comparison& comparison);

}  // namespace takt::lab
