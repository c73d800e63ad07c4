// SPDX-License-Identifier: Apache-2.0
// A comparison for the terminal and as JSON.
#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "lab/judge/compare.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

std::string title(const GroupComparison& group) {
  if (group.task.empty()) return "all perturbations together";
  if (group.dose == 0) return fmt::format("{}, {}", group.task, group.perturbation);
  return fmt::format("{}, {} at dose {:g}", group.task, group.perturbation, group.dose);
}

std::string interval_text(const MeanDifference& difference) {
  if (difference.interval) return fmt::format("[{:.4g}, {:.4g}]", difference.interval->low, difference.interval->high);
  return difference.seeds == 1 ? "one seed" : "too little spread";
}

std::string metric_line(const MetricDifference& metric) {
  const std::string name =
      metric.unit == "1" || metric.unit.empty() ? metric.metric : fmt::format("{} [{}]", metric.metric, metric.unit);
  if (metric.difference.pairs == 0) return fmt::format("  {:<36} no pair has this number\n", name);
  return fmt::format("  {:<36}{:>11.4g}{:>11.4g}{:>+11.4g}{:>8.0f} %  {:<26}{}{}\n", name, metric.mean_a, metric.mean_b,
                     metric.difference.mean, 100 * metric.b_better, interval_text(metric.difference),
                     metric.is_clear ? "*" : " ",
                     metric.left_out == 0 ? "" : fmt::format(" {} pairs left out", metric.left_out));
}

enum class Numbers : std::uint8_t { all, with_a_star };

std::string group_text(const GroupComparison& group, Numbers which) {
  const SuccessTable& success = group.success;
  std::string lines;
  for (const MetricDifference& metric : group.metrics)
    if (which == Numbers::all || metric.is_clear) lines += metric_line(metric);
  const std::string heads =
      fmt::format("  {:<36}{:>11}{:>11}{:>11}{:>10}  {}\n", "", "A", "B", "B - A", "B better", "95 % interval");
  return fmt::format("\n{} ({} pairs)\n  success: {}\n", title(group), success.pairs(), success_text(success)) +
         (lines.empty() ? "  none of its numbers has a star\n" : heads + lines);
}

std::string row_cells(const evidence::RolloutRow& row) {
  const auto& p99 = row.age_per_tick.total.p99_ms;
  return fmt::format("  {:<16}{:>8}{:>8.1f}", row.success ? "success" : row.failure_label,
                     p99 ? fmt::format("{:.1f}", *p99) : "none", 1e3 * row.tracking_error_rms_m);
}

Json json_of(const GroupComparison& group) {
  Json json;
  if (!group.task.empty()) json = {{"task", group.task}, {"perturbation", group.perturbation}, {"dose", group.dose}};
  json["pairs"] = group.success.pairs();
  json["success"] = {{"both", group.success.both},         {"only_a", group.success.only_a},
                     {"only_b", group.success.only_b},     {"neither", group.success.neither},
                     {"seeds", group.success.seeds},       {"exact_p", group.success.p_value},
                     {"evidence", group.success.evidence}, {"effective_pairs", group.success.effective_pairs}};
  json["metrics"] = Json::array();
  for (const MetricDifference& metric : group.metrics) {
    const auto& interval = metric.difference.interval;
    const bool any = metric.difference.pairs != 0;
    json["metrics"].push_back({{"metric", metric.metric},
                               {"unit", metric.unit},
                               {"pairs", metric.difference.pairs},
                               {"left_out", metric.left_out},
                               {"mean_a", any ? Json(metric.mean_a) : Json()},
                               {"mean_b", any ? Json(metric.mean_b) : Json()},
                               {"difference", any ? Json(metric.difference.mean) : Json()},
                               {"b_better", any ? Json(metric.b_better) : Json()},
                               {"interval", interval ? Json{interval->low, interval->high} : Json()},
                               {"p_value", any ? Json(metric.p_value) : Json()},
                               {"clear", metric.is_clear}});
  }
  return json;
}

std::string head_text(const Comparison& comparison) {
  std::string text = fmt::format("panel         {}\n", comparison.panel);
  text += fmt::format("A             {} of {}\n", comparison.a.method, comparison.a.artifact_id);
  text += fmt::format("B             {} of {}\n", comparison.b.method, comparison.b.artifact_id);
  for (const std::string& note : comparison.notes) text += fmt::format("note          {}\n", note);
  if (!comparison.configuration) return text;
  const auto value = [](const std::string& said) { return said.empty() ? "as the robot file has it" : said; };
  for (const ConfigurationDifference& one : *comparison.configuration)
    text += fmt::format("configuration {}: A {}, B {}\n", one.key, value(one.a), value(one.b));
  return comparison.configuration->empty() ? text + "configuration the same in panel.yaml\n" : text;
}

// The first line: who succeeds more often, if that is shown.
std::string verdict_text(const SuccessTable& success) {
  constexpr double kShown = 0.05;
  const std::uint64_t of_a = success.both + success.only_a, of_b = success.both + success.only_b;
  const std::string who = success.p_value > kShown ? "no difference in success is shown"
                          : of_a > of_b            ? "A succeeds more often"
                                                   : "B succeeds more often";
  return fmt::format("verdict       {}: A {} of {}, B {} of {}, exact p = {:.2g} over {} seeds\n", who, of_a,
                     success.pairs(), of_b, success.pairs(), success.p_value, success.seeds);
}

// Which of the other numbers over all pairs have a star; empty: none.
std::string clear_text(const std::vector<MetricDifference>& metrics) {
  std::string text;
  for (const MetricDifference& metric : metrics)
    if (metric.is_clear && metric.metric != "success" && metric.b_better != 0.5) {
      const bool is_b = metric.b_better > 0.5;
      text += fmt::format("              {}: {} is better, {:.4g} against {:.4g}{}{}*\n", metric.metric,
                          is_b ? 'B' : 'A', is_b ? metric.mean_b : metric.mean_a, is_b ? metric.mean_a : metric.mean_b,
                          metric.unit == "1" || metric.unit.empty() ? "" : " ", metric.unit == "1" ? "" : metric.unit);
    }
  return text;
}

Json json_of(const Side& side) {
  return {{"artifact_id", side.artifact_id},
          {"folder", side.folder},
          {"method", side.method},
          {"unpaired_rows", side.unpaired}};
}

}  // namespace

std::string comparison_text(const Comparison& comparison) {
  std::string text =
      verdict_text(comparison.pooled.success) + clear_text(comparison.pooled.metrics) + head_text(comparison);
  text += group_text(comparison.pooled, Numbers::all) + "  success " + any_look_text(comparison.pooled.success);
  if (comparison.margin) text += '\n' + margin_text(comparison, *comparison.margin);
  for (const GroupComparison& group : comparison.groups) text += group_text(group, Numbers::with_a_star);
  return text +
         "\nB better: share of the pairs, ties half.\n"
         "* survives Holm's correction over its table: without any difference at most one table in twenty has a "
         "star. Of one perturbation only those that have one are shown; --json has all.\n";
}

std::string comparison_rows_text(const Comparison& comparison) {
  constexpr std::string_view kHeads = "{:<16}{:<22}{:>8}{:>6}  {:<16}{:>8}{:>8}  {:<16}{:>8}{:>8}\n";
  std::string text = head_text(comparison) + '\n';
  text += fmt::format(kHeads, "task", "perturbation", "dose", "seed", "A", "p99 ms", "rms mm", "B", "p99 ms", "rms mm");
  for (const RowPair& pair : comparison.pairs) {
    text += fmt::format("{:<16}{:<22}{:>8g}{:>6}{}{}\n", pair.a.task, pair.a.perturbation, pair.a.dose, pair.a.seed,
                        row_cells(pair.a), row_cells(pair.b));
  }
  return text;
}

Json to_json(const Comparison& comparison) {
  Json json{{"schema", kComparisonSchema}, {"panel", comparison.panel}};
  json["a"] = json_of(comparison.a);
  json["b"] = json_of(comparison.b);
  json["notes"] = comparison.notes;
  if (comparison.configuration) {
    json["configuration"] = Json::array();
    for (const auto& [key, in_a, in_b] : *comparison.configuration)
      json["configuration"].push_back({{"key", key}, {"a", in_a}, {"b", in_b}});
  }
  json["bootstrap"] = {{"resamples", kResamples}, {"confidence", kConfidence}};
  if (comparison.margin) {
    const double width = comparison.margin->width;
    json["margin"] = {{"width", width},
                      {"verdict", name(margin_verdict(comparison, width))},
                      {"pairs_to_decide", pairs_to_decide(comparison, width)}};
  }
  json["pooled"] = json_of(comparison.pooled);
  json["groups"] = Json::array();
  for (const GroupComparison& group : comparison.groups) json["groups"].push_back(json_of(group));
  return json;
}

}  // namespace takt::lab
