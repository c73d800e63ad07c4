// SPDX-License-Identifier: Apache-2.0
// What the fault classifier said of a panel's rollouts against what was planted in them: one confusion matrix per
// method.
//
// A perturbation plants one cause, or none of those that the classifier names (a push is physics, not timing); rollouts
// of the latter kind are left out. A rollout's verdict is its leading one (rollout_row.hpp). A rollout without any
// trouble has none, and counts as not recognised where a cause was planted. Each verdict of a nominal rollout is a
// false alarm, which counts against that verdict's precision.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "evidence/rollout/rollout_row.hpp"
#include "monitor/judge/fault_classifier.hpp"

namespace takt::panel {

inline constexpr const char* kConfusionSchema = "takt.confusion/1";

// The cause that a perturbation of this name plants; empty: none, or no such perturbation.
std::optional<monitor::Fault> planted_fault(std::string_view perturbation);

// The costliest verdict: stops first, then missed ticks, then stretches; the first in the order of Fault among equals.
// Empty text: there is none.
std::string_view leading_fault(const monitor::FaultSummary& summary);

// Rollouts by verdict, in the order of Fault; the last: none.
using VerdictCounts = std::array<std::uint64_t, monitor::kFaultCount + 1>;
inline constexpr std::size_t kNoVerdict = monitor::kFaultCount;
// "inference_stall"; "none" for the last.
std::string_view verdict_name(std::size_t index);

struct Confusion {
  std::map<monitor::Fault, VerdictCounts> planted;          // by the planted cause
  VerdictCounts nominal{};                                  // by verdict
  [[nodiscard]] double recall(monitor::Fault fault) const;  // 0..1; 0 for a cause that was not planted
  // Of the rollouts with this verdict, the share in which it was planted; empty: none has it.
  [[nodiscard]] std::optional<double> precision(monitor::Fault fault) const;
  // Means over the planted causes; a precision that is empty counts as 0. Empty: none was planted.
  [[nodiscard]] std::optional<double> macro_recall() const;
  [[nodiscard]] std::optional<double> macro_precision() const;
  // Rollouts with a planted cause whose verdict is unknown, or that have none.
  [[nodiscard]] std::uint64_t abstained() const;
  [[nodiscard]] std::uint64_t nominal_rollouts() const;
  [[nodiscard]] std::uint64_t nominal_labelled() const;
};

// By method.
std::map<std::string, Confusion> confusions_of(std::span<const RolloutRow> rows);

// For the terminal; empty where no cause was planted.
std::string confusion_text(const std::map<std::string, Confusion>& confusions);
// Schema takt.confusion/1: what confusion.json of an artifact holds.
nlohmann::ordered_json confusion_json(const std::map<std::string, Confusion>& confusions,
                                      const std::string& artifact_id);

}  // namespace takt::panel
