// SPDX-License-Identifier: Apache-2.0
// What the fault classifier said of a panel's rollouts against what was planted in them: one confusion matrix per
// method.
//
// A kind of perturbation plants one cause, or none of those that the classifier names (a push is physics, not timing);
// rollouts without a planted cause are left out. A rollout's verdict is its leading one (rollout_row.hpp). A rollout
// without any trouble has none, and counts as not recognised where a cause was planted. Each verdict of a nominal
// rollout is a false alarm, which counts against that verdict's precision.
//
// A rollout with several planted causes is a mixture. It names each cause with a telling share of its troubled ticks.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>

#include "evidence/rollout/rollout_row.hpp"
#include "monitor/judge/fault_classifier.hpp"

namespace takt::lab {

inline constexpr const char* kConfusionSchema = "takt.confusion/1";

// The causes that a row's perturbation plants: of `push-with-can_loss-0.1`, that of `can_loss`.
std::set<monitor::Fault> planted_faults(std::string_view perturbation);

// The causes that a rollout names; of an earlier program's row, the leading one. Unknown is no name.
std::set<monitor::Fault> named_faults(const evidence::RolloutRow& row);

// The costliest verdict: stops first, then missed ticks, then stretches; the first in the order of Fault among equals.
// Empty text: there is none.
std::string_view leading_fault(const monitor::FaultSummary& summary);

// Rollouts by verdict, in the order of Fault; the last: none.
using VerdictCounts = std::array<std::uint64_t, monitor::kFaultCount + 1>;
inline constexpr std::size_t kNoVerdict = monitor::kFaultCount;
// "inference_stall"; "none" for the last.
std::string_view verdict_name(std::size_t index);

// Rollouts with several planted causes.
struct Mixtures {
  struct Cause {
    std::uint64_t planted = 0, named = 0, right = 0;  // rollouts; right: both
    [[nodiscard]] double recall() const;              // 0..1; 0 where it was not planted
    [[nodiscard]] std::optional<double> precision() const;
  };
  std::map<monitor::Fault, Cause> causes;
  std::uint64_t rollouts = 0, all_named = 0;
  void add(const evidence::RolloutRow& row);
};

struct Confusion {
  std::map<monitor::Fault, VerdictCounts> planted;  // by the planted cause
  VerdictCounts nominal{};                          // by verdict
  Mixtures mixtures;
  bool has_shares = false;                                  // a row says what each cause cost
  std::uint64_t named_besides = 0;                          // rollouts of one cause that name another one, too
  [[nodiscard]] double recall(monitor::Fault fault) const;  // 0..1; 0 for a cause that was not planted
  // The same of rollouts with any trouble; empty: there is none.
  [[nodiscard]] std::optional<double> recall_of_troubled(monitor::Fault fault) const;
  // Of the rollouts with this verdict, the share in which it was planted; empty: none has it.
  [[nodiscard]] std::optional<double> precision(monitor::Fault fault) const;
  // Means over the planted causes; a precision that is empty counts as 0. Empty: none was planted.
  [[nodiscard]] std::optional<double> macro_recall() const;
  [[nodiscard]] std::optional<double> macro_recall_of_troubled() const;  // over causes with trouble
  [[nodiscard]] std::optional<double> macro_precision() const;
  [[nodiscard]] std::uint64_t planted_rollouts() const;
  // Of them, whose verdict is unknown, or that have none.
  [[nodiscard]] std::uint64_t abstained() const;
  [[nodiscard]] std::uint64_t without_trouble() const;
  [[nodiscard]] std::uint64_t nominal_rollouts() const;
  [[nodiscard]] std::uint64_t nominal_labelled() const;
};

// By method.
std::map<std::string, Confusion> confusions_of(std::span<const evidence::RolloutRow> rows);

// For the terminal; empty where no cause was planted.
std::string confusion_text(const std::map<std::string, Confusion>& confusions);
// Schema takt.confusion/1: what confusion.json of an artifact holds.
nlohmann::ordered_json confusion_json(const std::map<std::string, Confusion>& confusions,
                                      const std::string& artifact_id);

}  // namespace takt::lab
