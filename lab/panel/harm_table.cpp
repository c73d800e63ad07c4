// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/harm_table.hpp"

#include <fmt/format.h>

#include <map>
#include <string_view>
#include <tuple>
#include <vector>

#include "evidence/rollout/method.hpp"
#include "lab/judge/paired_statistics.hpp"

namespace takt::lab {
namespace {

struct Duel {
  std::uint64_t pairs = 0, takt = 0, rival = 0, only_takt = 0, only_rival = 0;
  void add(bool takt_succeeds, bool rival_succeeds) {
    ++pairs;
    takt += takt_succeeds ? 1U : 0U;
    rival += rival_succeeds ? 1U : 0U;
    only_takt += takt_succeeds && !rival_succeeds ? 1U : 0U;
    only_rival += rival_succeeds && !takt_succeeds ? 1U : 0U;
  }
};

std::string_view verdict_of(const Interval& difference) {
  if (difference.low > 0) return "better";
  if (difference.low >= -kHarmMargin) return "holds";
  return difference.high < -kHarmMargin ? "fails" : "open";
}

std::string line(std::string_view task, std::string_view perturbation, const std::string& dose, std::string_view rival,
                 const Duel& duel) {
  const Interval difference = paired_rate_interval(duel.only_takt, duel.only_rival, duel.pairs);
  const double found =
      (static_cast<double>(duel.takt) - static_cast<double>(duel.rival)) / static_cast<double>(duel.pairs);
  return fmt::format("{:<17} {:<21} {:>7} {:<10} {:>6} {:>6} {:>6} {:>+7.1f} {:>17} {:<6}\n", task, perturbation, dose,
                     rival, duel.pairs, duel.takt, duel.rival, 100 * found,
                     fmt::format("[{:+.1f} {:+.1f}]", 100 * difference.low, 100 * difference.high),
                     verdict_of(difference));
}

bool is_rival(const std::string& method) {
  const evidence::BuiltInMethod* const built_in = evidence::find_built_in(method);
  return built_in != nullptr && built_in->which != evidence::BuiltIn::takt;
}

}  // namespace

std::string harm_table(std::span<const evidence::RolloutRow> rows) {
  std::map<evidence::PairKey, bool> takt;
  for (const evidence::RolloutRow& row : rows)
    if (row.method == "takt") takt.emplace(evidence::pair_key(row), row.success);
  using Cell = std::tuple<std::string, std::string, double, std::string>;  // task, perturbation, dose, rival
  std::vector<Cell> order;
  std::map<Cell, Duel> cells;
  std::map<std::string, std::pair<Duel, Duel>> sums;  // nominal, and all others
  for (const evidence::RolloutRow& row : rows) {
    const auto found = takt.find(evidence::pair_key(row));
    if (!is_rival(row.method) || found == takt.end()) continue;
    const Cell cell{row.task, row.perturbation, row.dose, row.method};
    const auto [duel, is_new] = cells.try_emplace(cell);
    if (is_new) order.push_back(cell);
    duel->second.add(found->second, row.success);
    auto& [nominal, troubled] = sums[row.method];
    (row.perturbation == "none" ? nominal : troubled).add(found->second, row.success);
  }
  if (order.empty()) return {};
  std::string table = fmt::format("{:<17} {:<21} {:>7} {:<10} {:>6} {:>6} {:>6} {:>7} {:>17} {:<6}\n", "takt against",
                                  "perturbation", "dose", "rival", "pairs", "takt", "rival", "points", "95 %",
                                  fmt::format("margin {:g}", 100 * kHarmMargin));
  for (const auto& cell : order) {
    const auto& [task, perturbation, dose, rival] = cell;
    table += line(task, perturbation, fmt::format("{:.4g}", dose), rival, cells[cell]);
  }
  for (const auto& [rival, both] : sums) {
    if (both.first.pairs != 0) table += line("all", "none", "", rival, both.first);
    if (both.second.pairs != 0) table += line("all", "troubled", "", rival, both.second);
  }
  return table;
}

}  // namespace takt::lab
