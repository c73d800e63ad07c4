// SPDX-License-Identifier: Apache-2.0
// What a comparison's success decides: within a margin, and at every look.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lab/judge/compare.hpp"

namespace takt::lab {
namespace {

// The pooled difference of success, in which every pair has a part.
const MeanDifference& success_of(const Comparison& comparison) {
  return std::ranges::find(comparison.pooled.metrics, "success", &MetricDifference::metric)->difference;
}

}  // namespace

MarginVerdict margin_verdict(const Comparison& comparison, double margin) {
  const Interval interval = success_of(comparison).interval.value();
  if (interval.low > 0) return MarginVerdict::superior;
  if (interval.low > -margin) return MarginVerdict::non_inferior;
  return interval.high < -margin ? MarginVerdict::inferior : MarginVerdict::undecided;
}

std::string_view name(MarginVerdict verdict) {
  switch (verdict) {
    case MarginVerdict::superior:
      return "superior";
    case MarginVerdict::non_inferior:
      return "non-inferior";
    case MarginVerdict::inferior:
      return "inferior";
    case MarginVerdict::undecided:
      return "undecided";
  }
  return "";
}

std::uint64_t pairs_to_decide(const Comparison& comparison, double margin) {
  constexpr double kEnd = 1.959964, kPower = 1.281552;  // 97.5 % and 90 % of the normal distribution lie below
  const SuccessTable& success = comparison.pooled.success;
  const auto pairs = static_cast<double>(success.pairs());
  const double discordant = static_cast<double>(success.only_a + success.only_b) / pairs;
  // A pair's variance if B is worse by the margin, with the rate of "only A" that then fits best.
  const double slope = 2 * margin + discordant;
  const double only_a = (std::sqrt(slope * slope - 4 * discordant * margin * (1 + margin)) + slope) / 4;
  const double at_margin = 2 * only_a - margin * (1 + margin);
  const double ends = kEnd * std::sqrt(at_margin) + kPower * std::sqrt(discordant);
  const double needed = std::max(kEnd * kEnd / margin, std::pow(ends / margin, 2));
  return static_cast<std::uint64_t>(std::ceil(needed * pairs / success.effective_pairs));
}

std::string margin_text(const Comparison& comparison, const SuccessMargin& margin) {
  const Interval interval = success_of(comparison).interval.value();
  std::string text =
      fmt::format("margin {:g} %: B is {} in success ({:+.2g} % to {:+.2g} %)\n", 100 * margin.width,
                  name(margin_verdict(comparison, margin.width)), 100 * interval.low, 100 * interval.high);
  if (margin.with_plan) {
    const SuccessTable& success = comparison.pooled.success;
    text += fmt::format(
        "plan: {} pairs show that B is non-inferior, with 90 % probability, if both succeed equally often and {:.3g} % "
        "of pairs differ\n",
        pairs_to_decide(comparison, margin.width),
        100 * static_cast<double>(success.only_a + success.only_b) / static_cast<double>(success.pairs()));
  }
  return text;
}

std::string any_look_text(const SuccessTable& success) {
  const double decided = 1 / kSignificance;
  const bool is_decided = success.evidence >= decided;
  return fmt::format("at any look: {}, evidence {:.3g} of {:g}\n",
                     !is_decided                                 ? "undecided"
                     : success.seeds_for_b > success.seeds_for_a ? "B succeeds more often"
                                                                 : "A succeeds more often",
                     success.evidence, decided);
}

std::string success_text(const SuccessTable& success) {
  const std::string test = success.seeds == success.pairs()
                               ? "exact McNemar p"
                               : fmt::format("exact p over {} seed{}", success.seeds, success.seeds == 1 ? "" : "s");
  return fmt::format("A {} of {}, B {} of {}; only A {}, only B {}, {} = {:.4g}", success.both + success.only_a,
                     success.pairs(), success.both + success.only_b, success.pairs(), success.only_a, success.only_b,
                     test, success.p_value);
}

}  // namespace takt::lab
