// SPDX-License-Identifier: Apache-2.0
// Which of two methods succeeds more often, decided while their panel runs: after every whole seed, by
// anytime_evidence(). However often it looks, it errs with a probability of at most kSignificance.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "evidence/rollout/rollout_row.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

class SequentialDecision {
 public:
  // `plan` becomes the rollouts of these two methods, seed by seed.
  SequentialDecision(std::array<std::string, 2> methods, std::vector<PlannedRollout>& plan);

  // Rows come in the plan's order.
  void add(const evidence::RolloutRow& row);
  // Never within a seed.
  [[nodiscard]] bool is_made() const;
  [[nodiscard]] std::uint64_t seeds() const { return seeds_; }  // whole ones
  [[nodiscard]] double evidence() const;
  // One line: which method, after how many seeds.
  [[nodiscard]] std::string text() const;

 private:
  std::array<std::string, 2> methods_;
  std::size_t rows_per_seed_ = 0, rows_of_seed_ = 0;
  std::array<std::uint64_t, 2> successes_of_seed_{};
  std::array<std::uint64_t, 2> seeds_for_{};  // in which that method succeeded more often
  std::uint64_t seeds_ = 0;
};

// "A,B": two different methods of the panel, which keeps only these. The error is one sentence.
std::expected<std::array<std::string, 2>, std::string> keep_two_methods(std::string_view names, Panel& panel);

}  // namespace takt::lab
