// SPDX-License-Identifier: Apache-2.0
// A comparison as one HTML file: no script, no request, light and dark.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/xml_text.hpp"
#include "lab/judge/compare.hpp"

namespace takt::lab {
namespace {

constexpr std::string_view kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>takt compare</title>
<style>
:root { color-scheme: light dark; font: 15px/1.5 system-ui, sans-serif; }
body { max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; margin: .5rem 0 2rem; }
th, td { padding: .2rem .7rem; text-align: right; border-bottom: 1px solid #8884; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; }
.clear { font-weight: 600; }
.note { border-left: 4px solid #c80; padding-left: .8rem; }
line { stroke: #888; } rect { fill: #38c; } circle { fill: currentColor; }
</style></head><body>
)";

// The interval as a bar around zero, scaled so that its far end touches the edge.
std::string bar(const MeanDifference& difference) {
  if (!difference.interval) return "";
  constexpr double kHalf = 80;
  const double far = std::max({std::abs(difference.interval->low), std::abs(difference.interval->high)});
  if (far == 0) return "";
  const auto place = [&](double value) { return kHalf + kHalf * value / far; };
  const double low = place(difference.interval->low), high = place(difference.interval->high);
  return fmt::format(
      R"(<svg width="160" height="14" role="img" aria-label="interval"><line x1="80" x2="80" y1="0" y2="14"/>)"
      R"(<rect x="{:.1f}" y="5" width="{:.1f}" height="4"/><circle cx="{:.1f}" cy="7" r="3"/></svg>)",
      low, std::max(1.0, high - low), place(difference.mean));
}

std::string metric_row(const MetricDifference& metric) {
  const MeanDifference& difference = metric.difference;
  const std::string unit = metric.unit == "1" || metric.unit.empty() ? "" : " [" + metric.unit + "]";
  if (difference.pairs == 0) {
    return fmt::format("<tr><td>{}{}</td><td colspan=\"7\">no pair has this number</td></tr>\n", metric.metric, unit);
  }
  const std::string interval =
      difference.interval ? fmt::format("{:.4g} to {:.4g}", difference.interval->low, difference.interval->high)
                          : (difference.seeds == 1 ? "one seed" : "too little spread");
  return fmt::format(
      "<tr{}><td>{}{}</td><td>{}</td><td>{:.4g}</td><td>{:.4g}</td><td>{:+.4g}</td><td>{:.0f} "
      "%</td><td>{}</td><td>{}</td></tr>\n",
      metric.is_clear ? " class=\"clear\"" : "", metric.metric, unit, difference.pairs, metric.mean_a, metric.mean_b,
      difference.mean, 100 * metric.b_better, interval, bar(difference));
}

std::string group_html(const GroupComparison& group) {
  std::string html = group.task.empty() ? std::string("<h2>All perturbations together</h2>\n")
                                        : fmt::format("<h2>{}, {} at dose {:g}</h2>\n", config::xml_text(group.task),
                                                      config::xml_text(group.perturbation), group.dose);
  html += fmt::format(
      "<p>Success: {}</p>\n<table><tr><th>metric</th><th>pairs</th><th>A</th><th>B</th><th>B - A</th><th>B better</th>"
      "<th>95 % interval</th><th></th></tr>\n",
      success_text(group.success));
  for (const MetricDifference& metric : group.metrics) html += metric_row(metric);
  return html + "</table>\n";
}

std::string outcome(const evidence::RolloutRow& row) {
  return row.success ? "success" : config::xml_text(row.failure_label);
}

std::string age(const evidence::RolloutRow& row) {
  const auto& p95 = row.age_per_command.total.p95_ms;
  return p95 ? fmt::format("{:.2f}", *p95) : "none";
}

std::string pairs_html(const Comparison& comparison) {
  std::string html =
      "<h2>Row by row</h2>\n<table><tr><th>task</th><th>perturbation</th><th>dose</th><th>seed</th><th>A</th><th>B</th>"
      "<th>p95 age A [ms]</th><th>p95 age B [ms]</th></tr>\n";
  for (const RowPair& pair : comparison.pairs) {
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{:g}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        config::xml_text(pair.a.task), config::xml_text(pair.a.perturbation), pair.a.dose, pair.a.seed, outcome(pair.a),
        outcome(pair.b), age(pair.a), age(pair.b));
  }
  return html + "</table>\n";
}

// Rows: what was planted; columns: verdicts that occur at all.
std::string confusion_html(std::string_view side, const std::string& method, const Confusion& confusion) {
  std::vector<std::size_t> columns;
  for (std::size_t verdict = 0; verdict <= kNoVerdict; ++verdict)
    if (std::ranges::any_of(confusion.planted, [&](const auto& row) { return row.second[verdict] != 0; }))
      columns.push_back(verdict);
  std::string html = fmt::format(
      "<h3>{}: {}</h3>\n<p>Macro recall {:.3f}; nominal rollouts with a verdict: {} of {}.</p>\n<table><tr>"
      "<th>planted</th>",
      side, config::xml_text(method), confusion.macro_recall().value_or(0), confusion.nominal_labelled(),
      confusion.nominal_rollouts());
  for (const std::size_t verdict : columns) html += fmt::format("<th>{}</th>", verdict_name(verdict));
  html += "<th>recall</th></tr>\n";
  for (const auto& [fault, counts] : confusion.planted) {
    html += fmt::format("<tr><td>{}</td>", name(fault));
    for (const std::size_t verdict : columns)
      html += fmt::format("<td{}>{}</td>", verdict == static_cast<std::size_t>(fault) ? " class=\"clear\"" : "",
                          counts[verdict]);
    html += fmt::format("<td>{:.3f}</td></tr>\n", confusion.recall(fault));
  }
  return html + "</table>\n";
}

std::string configuration_html(const Comparison& comparison) {
  if (!comparison.configuration || comparison.configuration->empty()) return "";
  std::string html = "<h2>In what the methods differ</h2>\n<table><tr><th>key</th><th>A</th><th>B</th></tr>\n";
  const auto value = [](const std::string& said) {
    return said.empty() ? "as the robot file has it" : config::xml_text(said);
  };
  for (const auto& [key, in_a, in_b] : *comparison.configuration)
    html +=
        fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", config::xml_text(key), value(in_a), value(in_b));
  return html + "</table>\n";
}

std::string confusions_html(const Comparison& comparison) {
  if (!comparison.a.confusion || !comparison.b.confusion) return "";
  return "<h2>Fault classifier: planted causes against verdicts</h2>\n" +
         confusion_html("A", comparison.a.method, *comparison.a.confusion) +
         confusion_html("B", comparison.b.method, *comparison.b.confusion);
}

}  // namespace

std::string comparison_html(const Comparison& comparison) {
  std::string html(kHead);
  html += fmt::format(
      "<h1>{}: A {} against B {}</h1>\n<p>A from {}, B from {}. {} pairs of task, perturbation, dose and "
      "seed. Bold: survives Holm's correction over its table; without any difference "
      "at most one table in twenty has such a line.</p>\n",
      config::xml_text(comparison.panel), config::xml_text(comparison.a.method), config::xml_text(comparison.b.method),
      config::xml_text(comparison.a.artifact_id), config::xml_text(comparison.b.artifact_id), comparison.pairs.size());
  for (const std::string& note : comparison.notes)
    html += fmt::format("<p class=\"note\">{}</p>\n", config::xml_text(note));
  html += configuration_html(comparison);
  if (comparison.margin) html += fmt::format("<p>{}</p>\n", margin_text(comparison, *comparison.margin));
  html += group_html(comparison.pooled) + fmt::format("<p>Success {}</p>\n", any_look_text(comparison.pooled.success));
  for (const GroupComparison& group : comparison.groups) html += group_html(group);
  return html + confusions_html(comparison) + pairs_html(comparison) + "</body></html>\n";
}

}  // namespace takt::lab
