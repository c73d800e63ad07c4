// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/panel_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <optional>
#include <tuple>
#include <vector>

#include "monitor/judge/freshness_statistics.hpp"

namespace takt::lab {
namespace {

using Group = std::vector<const evidence::RolloutRow*>;

std::optional<double> median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

template <class Field>
std::optional<double> median_of(const Group& rows, Field field) {
  std::vector<double> values;
  for (const evidence::RolloutRow* row : rows)
    if (const std::optional<double> value = field(*row)) values.push_back(*value);
  return median(std::move(values));
}

template <class Field>
double mean_of(const Group& rows, Field field) {
  double sum = 0;
  for (const evidence::RolloutRow* row : rows) sum += static_cast<double>(field(*row));
  return sum / static_cast<double>(rows.size());
}

std::string text(std::optional<double> value, double factor = 1) {
  return value ? fmt::format("{:.1f}", *value * factor) : "-";
}

// Clopper-Pearson, both ends at 97.5 %.
std::string success_text(const Group& rows) {
  const auto good = static_cast<std::uint64_t>(std::ranges::count_if(rows, &evidence::RolloutRow::success));
  const std::uint64_t count = rows.size();
  const double high = monitor::clopper_pearson_upper(good, count, 0.975);
  const double low = 1 - monitor::clopper_pearson_upper(count - good, count, 0.975);
  return fmt::format("{}/{} [{:.2f} {:.2f}]", good, count, low, high);
}

std::string line(const Group& rows) {
  const evidence::RolloutRow& first = *rows.front();
  return fmt::format(
      "{:<12} {:<21} {:>7.4g} {:<8} {:>19} {:>8} {:>8} {:>9.1f} {:>6.2f} {:>6.2f} {:>8} {:>8}\n", first.task,
      first.perturbation, first.dose, first.method, success_text(rows),
      text(median_of(rows, [](const evidence::RolloutRow& row) { return row.age_per_tick.total.p99_ms; })),
      text(median_of(rows, [](const evidence::RolloutRow& row) { return std::optional(row.tracking_error_rms_m); }),
           1e3),
      mean_of(rows, [](const evidence::RolloutRow& row) { return row.constraint_violations; }),
      mean_of(rows, [](const evidence::RolloutRow& row) { return row.safety.entered_degraded; }),
      mean_of(rows,
              [](const evidence::RolloutRow& row) {
                return row.safety.entered_damped_stop + row.safety.entered_fault_latched;
              }),
      text(median_of(rows, [](const evidence::RolloutRow& row) { return std::optional(row.peak_torque_Nm); })),
      text(median_of(rows, [](const evidence::RolloutRow& row) { return row.recovery_s; })));
}

bool belong_together(const evidence::RolloutRow& a, const evidence::RolloutRow& b) {
  return std::tie(a.task, a.perturbation, a.dose, a.method) == std::tie(b.task, b.perturbation, b.dose, b.method);
}

std::vector<Group> groups_of(std::span<const evidence::RolloutRow> rows) {
  std::vector<Group> groups;
  for (const evidence::RolloutRow& row : rows) {
    const auto found =
        std::ranges::find_if(groups, [&](const Group& group) { return belong_together(*group.front(), row); });
    if (found == groups.end())
      groups.push_back({&row});
    else
      found->push_back(&row);
  }
  return groups;
}

std::string latency_line(const Group& rows) {
  const evidence::RolloutRow& first = *rows.front();
  std::uint64_t misses = 0, count = 0;
  for (const evidence::RolloutRow* row : rows) {
    misses += row->misses_per_tick.misses;
    count += row->misses_per_tick.count;
  }
  const auto age = [&](std::optional<double> evidence::AgeQuantiles::*quantile) {
    return text(median_of(rows, [&](const evidence::RolloutRow& row) { return row.age_per_tick.total.*quantile; }));
  };
  return fmt::format(
      "{:<12} {:<21} {:>7.4g} {:<8} {:>14} {:>13} {:>8} {:>8} {:>8} {:>15} {:>7.4f}\n", first.task, first.perturbation,
      first.dose, first.method,
      text(median_of(rows, [](const evidence::RolloutRow& row) { return row.inference_mean_ms; })),
      text(median_of(rows, [](const evidence::RolloutRow& row) { return row.age_per_command.queue.p99_ms; })),
      age(&evidence::AgeQuantiles::p50_ms), age(&evidence::AgeQuantiles::p95_ms), age(&evidence::AgeQuantiles::p99_ms),
      fmt::format("{}/{}", misses, count), count == 0 ? 0.0 : static_cast<double>(misses) / static_cast<double>(count));
}

std::string motion_line(const Group& rows) {
  const evidence::RolloutRow& first = *rows.front();
  std::uint64_t touched = 0, ticks = 0;
  for (const evidence::RolloutRow* row : rows) {
    for (const Intervention kind : {Intervention::velocity_limit, Intervention::acceleration_limit})
      touched += row->interventions[static_cast<std::size_t>(std::countr_zero(bit(kind)))];
    ticks += row->ticks;
  }
  const auto jerk =
      median_of(rows, [](const evidence::RolloutRow& row) { return std::optional(row.peak_reference_jerk); });
  const auto step =
      median_of(rows, [](const evidence::RolloutRow& row) { return std::optional(row.peak_join_velocity_step); });
  return fmt::format("{:<12} {:<21} {:>7.4g} {:<12} {:>19} {:>16.0f} {:>16.4f} {:>22.4f}\n", first.task,
                     first.perturbation, first.dose, first.method, success_text(rows), jerk.value_or(0),
                     step.value_or(0), ticks == 0 ? 0.0 : static_cast<double>(touched) / static_cast<double>(ticks));
}

}  // namespace

std::string panel_table(std::span<const evidence::RolloutRow> rows) {
  std::string table = fmt::format("{:<12} {:<21} {:>7} {:<8} {:>19} {:>8} {:>8} {:>9} {:>6} {:>6} {:>8} {:>8}\n",
                                  "task", "perturbation", "dose", "method", "success [95 %]", "p99 ms", "rms mm",
                                  "violated", "degr.", "stops", "peak Nm", "recov. s");
  for (const Group& group : groups_of(rows)) table += line(group);
  return table;
}

std::string latency_table(std::span<const evidence::RolloutRow> rows) {
  std::string table = fmt::format("{:<12} {:<21} {:>7} {:<8} {:>14} {:>13} {:>8} {:>8} {:>8} {:>15} {:>7}\n", "task",
                                  "perturbation", "dose", "method", "mean infer ms", "queue p99 ms", "p50 ms", "p95 ms",
                                  "p99 ms", "missed ticks", "rate");
  for (const Group& group : groups_of(rows)) table += latency_line(group);
  return table;
}

std::string motion_table(std::span<const evidence::RolloutRow> rows) {
  std::string table =
      fmt::format("{:<12} {:<21} {:>7} {:<12} {:>19} {:>16} {:>16} {:>22}\n", "task", "perturbation", "dose", "method",
                  "success [95 %]", "peak jerk rad/s3", "join step rad/s", "limits, joints per tick");
  for (const Group& group : groups_of(rows)) table += motion_line(group);
  return table;
}

}  // namespace takt::lab
