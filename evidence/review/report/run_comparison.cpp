// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/run_comparison.hpp"

#include <fmt/format.h>

#include <numeric>

#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::evidence {
namespace {

using Json = nlohmann::ordered_json;

std::int64_t started_unix_ns(const monitor::RunManifest& manifest) {
  return manifest.started_at.ns + manifest.clock.monotonic_to_unix_ns;
}

using Number = std::optional<double>;

// None where it is not, and where its object counted nothing: the age of no command is not 0 ms.
Number number_at(const Json& metrics, const std::string& object, const std::string& key) {
  const Json::json_pointer at(object);
  if (!metrics.contains(at)) return {};
  const Json& found = metrics.at(at);
  if (!found.is_object() || found.value("count", Json()) == 0) return {};
  if (!found.contains(key) || !found.at(key).is_number()) return {};
  return found.at(key).get<double>();
}

Number sum_at(const Json& metrics, const char* object, std::string_view but = {}) {
  double sum = 0;
  if (!metrics.contains(object)) return {};
  for (const auto& [key, value] : metrics.at(object).items()) {
    if (key != but && value.is_number()) sum += value.template get<double>();
  }
  return sum;
}

Number scaled(Number number, double factor) {
  return number ? Number(*number * factor) : number;
}

Number difference(Number minuend, Number subtrahend) {
  return minuend && subtrahend ? Number(*minuend - *subtrahend) : Number();
}

// The numbers of one run, in the order in which they are shown.
std::vector<ComparisonRow> numbers_of(const Json& metrics) {
  std::vector<ComparisonRow> rows;
  const auto add = [&](std::string label, std::string unit, Number value) {
    rows.push_back({std::move(label), std::move(unit), {}, value});
  };
  for (const char* quantile : {"p50", "p95", "p99", "p99.9", "max"}) {
    add(fmt::format("age per command, {}", quantile), "ms",
        scaled(number_at(metrics, "/age_ns/per_command/total", quantile), 1e-6));
  }
  for (const char* part : {"sense", "queue", "infer", "publish"}) {
    add(fmt::format("{}, p99", part), "ms",
        scaled(number_at(metrics, fmt::format("/age_ns/per_command/{}", part), "p99"), 1e-6));
  }
  for (const char* per : {"command", "tick"}) {
    const std::string misses = fmt::format("/deadline_misses/per_{}", per);
    add(fmt::format("misses per {}", per), "%", scaled(number_at(metrics, misses, "rate"), 100));
    add(fmt::format("at most, per {}", per), "%", scaled(number_at(metrics, misses, "upper_bound"), 100));
  }
  const double ticks = number_at(metrics, "/ticks", "recorded").value_or(0);
  for (std::size_t mode = 0; mode < kModeCount; ++mode) {
    const std::string name(takt::name(static_cast<Mode>(mode)));
    const Number in_mode = ticks > 0 ? number_at(metrics, "/ticks_in_mode", name) : Number();
    add(fmt::format("in {}", name), "%", scaled(in_mode, 100 / ticks));
  }
  add("transitions", "", number_at(metrics, "", "transition_count"));
  add("interventions", "joint-ticks", sum_at(metrics, "interventions"));
  add("refused commands", "",
      difference(sum_at(metrics, "arrivals", "none"), number_at(metrics, "/arrivals", "accepted")));
  add("overruns", "", sum_at(metrics, "overruns", "none"));
  add("wake-up late, p99", "us", scaled(number_at(metrics, "/lateness_ns", "p99"), 1e-3));
  add("work per tick, p99", "us", scaled(number_at(metrics, "/work_ns", "p99"), 1e-3));
  add("recorded", "s", scaled(number_at(metrics, "/ticks", "span_ns"), 1e-9));
  return rows;
}

std::string shown(Number number) {
  return number ? fmt::format("{:.3f}", *number) : "-";
}

Json json_of(Number number) {
  return number ? Json(*number) : Json(nullptr);
}

std::expected<Json, std::string> metrics_json_of(const monitor::RecordedRun& run) {
  if (const auto text = monitor::read_file(run.folder.metrics())) {
    Json json = Json::parse(*text, nullptr, false);
    const bool is_its_own = json.is_object() && json.value("schema", "") == "takt.metrics/1" &&
                            json.value("run_id", "") == run.manifest.run_id;
    if (is_its_own) return json;
  }
  const auto metrics = monitor::metrics_of(run);
  if (!metrics) return std::unexpected(metrics.error());
  return to_json(*metrics, run);
}

}  // namespace

std::expected<RunComparison, std::string> compare_with(const Json& metrics, const std::string& other_path) {
  const auto other = monitor::open_run(other_path);
  if (!other) return std::unexpected(other.error());
  const auto numbers = metrics_json_of(*other);
  if (!numbers) return std::unexpected(numbers.error());
  RunComparison comparison{other->manifest.run_id, other_path, monitor::utc_text(started_unix_ns(other->manifest)),
                           numbers->value("contract", Json()) == metrics.value("contract", Json()),
                           numbers_of(metrics)};
  const auto theirs = numbers_of(*numbers);
  for (std::size_t row = 0; row < theirs.size(); ++row) comparison.rows[row].other = theirs[row].here;
  return comparison;
}

std::string comparison_text(const RunComparison& comparison) {
  std::string text = fmt::format("\nagainst       {} ({})\n  {:<24}{:>12}{:>12}{:>12}\n", comparison.other_id,
                                 comparison.other_started, "", "other", "this", "difference");
  for (const ComparisonRow& row : comparison.rows) {
    if (row.other == row.here && row.here.value_or(0) == 0) continue;
    const Number change = difference(row.here, row.other);
    text += fmt::format("  {:<24}{:>12}{:>12}{:>12} {}\n", row.label, shown(row.other), shown(row.here),
                        change ? fmt::format("{:+.3f}", *change) : "-", row.unit);
  }
  if (!comparison.same_contract) text += "  another contract: a miss is not the same thing in both\n";
  return text;
}

Json to_json(const RunComparison& comparison) {
  Json rows = Json::array();
  for (const ComparisonRow& row : comparison.rows) {
    rows.push_back({row.label, row.unit, json_of(row.other), json_of(row.here)});
  }
  return {{"other_id", comparison.other_id},
          {"other_path", comparison.other_path},
          {"other_started", comparison.other_started},
          {"same_contract", comparison.same_contract},
          {"rows", rows}};
}

}  // namespace takt::evidence
