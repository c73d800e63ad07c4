// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/sequential_decision.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "lab/judge/paired_statistics.hpp"

namespace takt::lab {

SequentialDecision::SequentialDecision(std::array<std::string, 2> methods, std::vector<PlannedRollout>& plan)
    : methods_(std::move(methods)) {
  std::ranges::stable_sort(plan, {}, &PlannedRollout::seed);
  if (!plan.empty())
    rows_per_seed_ = static_cast<std::size_t>(std::ranges::count(plan, plan.front().seed, &PlannedRollout::seed));
}

void SequentialDecision::add(const evidence::RolloutRow& row) {
  if (row.success) ++successes_of_seed_[row.method == methods_[0] ? 0 : 1];
  if (++rows_of_seed_ < rows_per_seed_) return;
  if (successes_of_seed_[0] > successes_of_seed_[1]) ++seeds_for_[0];
  if (successes_of_seed_[1] > successes_of_seed_[0]) ++seeds_for_[1];
  ++seeds_;
  rows_of_seed_ = 0;
  successes_of_seed_ = {};
}

bool SequentialDecision::is_made() const {
  return rows_of_seed_ == 0 && evidence() >= 1 / kSignificance;
}

double SequentialDecision::evidence() const {
  return anytime_evidence(seeds_for_[0], seeds_for_[1]);
}

std::string SequentialDecision::text() const {
  const std::string what = is_made() ? fmt::format("decided: {} succeeds more often than {}",
                                                   methods_[seeds_for_[0] > seeds_for_[1] ? 0 : 1],
                                                   methods_[seeds_for_[0] > seeds_for_[1] ? 1 : 0])
                                     : fmt::format("undecided between {} and {}", methods_[0], methods_[1]);
  return fmt::format("{} after {} seed{}, evidence {:.3g} of {:g}", what, seeds_, seeds_ == 1 ? "" : "s", evidence(),
                     1 / kSignificance);
}

std::expected<std::array<std::string, 2>, std::string> keep_two_methods(std::string_view names, Panel& panel) {
  const std::size_t comma = names.find(',');
  if (comma == std::string_view::npos || names.find(',', comma + 1) != std::string_view::npos)
    return std::unexpected("write two methods, such as takt,plain");
  std::array<std::string, 2> two{std::string(names.substr(0, comma)), std::string(names.substr(comma + 1))};
  if (two[0] == two[1]) return std::unexpected("write two different methods");
  for (const std::string& name : two)
    if (std::ranges::find(panel.methods, name, &PanelMethod::name) == panel.methods.end())
      return std::unexpected(fmt::format("the panel has no method {}", name));
  std::erase_if(panel.methods, [&](const PanelMethod& one) { return one.name != two[0] && one.name != two[1]; });
  return two;
}

}  // namespace takt::lab
