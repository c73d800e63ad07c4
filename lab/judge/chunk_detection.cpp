// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/chunk_detection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace takt::lab {
namespace {

bool is_caught(const monitor::ChunkScores& levels, std::span<const config::ChunkThreshold> thresholds) {
  return std::ranges::any_of(thresholds, [&](const config::ChunkThreshold& one) {
    return levels[static_cast<std::size_t>(one.score)] > one.above;
  });
}

std::vector<double> values_of(std::span<const evidence::RolloutRow* const> rows, bool successful, std::size_t score) {
  std::vector<double> values;
  for (const evidence::RolloutRow* const row : rows)
    if (row->success == successful) values.push_back(row->chunk_levels[score]);
  return values;
}

std::uint64_t middle_seed(std::span<const evidence::RolloutRow> rows) {
  const auto [least, most] = std::ranges::minmax(rows, {}, &evidence::RolloutRow::seed);
  return least.seed + (most.seed - least.seed) / 2;
}

}  // namespace

std::expected<std::vector<config::ChunkThreshold>, std::string> calibrate(std::span<const monitor::ChunkScores> usual,
                                                                          std::span<const config::ChunkScore> scores,
                                                                          double alarms) {
  const double each = alarms / static_cast<double>(scores.size());
  const double place = std::ceil(static_cast<double>(usual.size() + 1) * (1 - each) - 1e-9);
  const std::size_t rank = std::max<std::size_t>(1, static_cast<std::size_t>(place));
  if (rank > usual.size() || usual.empty())
    return std::unexpected(
        fmt::format("{} stretches without a fault are too few for {} scores and {:g} of alarms: record {} or more, "
                    "watch fewer scores, or allow more alarms",
                    usual.size(), scores.size(), alarms, static_cast<std::size_t>(std::ceil(1 / each - 1e-9)) - 1));
  std::vector<config::ChunkThreshold> thresholds;
  for (const config::ChunkScore score : scores) {
    std::vector<double> levels;
    for (const monitor::ChunkScores& one : usual) levels.push_back(one[static_cast<std::size_t>(score)]);
    const auto at = levels.begin() + static_cast<std::ptrdiff_t>(rank - 1);
    std::ranges::nth_element(levels, at);
    thresholds.push_back({score, *at});
  }
  return thresholds;
}

std::optional<Auroc> auroc_of(std::span<const double> failed, std::span<const double> successful) {
  if (failed.empty() || successful.empty()) return std::nullopt;
  double wins = 0;
  for (const double bad : failed)
    for (const double good : successful) wins += bad > good ? 1.0 : bad == good ? 0.5 : 0.0;
  const auto m = static_cast<double>(failed.size()), n = static_cast<double>(successful.size());
  const double area = wins / (m * n);
  const double both_bad = area / (2 - area), both_good = 2 * area * area / (1 + area);
  const double variance =
      (area * (1 - area) + (m - 1) * (both_bad - area * area) + (n - 1) * (both_good - area * area)) / (m * n);
  const double reach = 1.96 * std::sqrt(std::max(0.0, variance));
  return Auroc{area, std::max(0.0, area - reach), std::min(1.0, area + reach)};
}

std::expected<ChunkDetection, std::string> detection_of(std::span<const evidence::RolloutRow> rows,
                                                        std::span<const config::ChunkScore> scores, double alarms) {
  if (rows.empty()) return std::unexpected("no rollout of this task and method");
  ChunkDetection made;
  made.task = rows.front().task;
  made.method = rows.front().method;
  made.rule.votes = static_cast<int>(rows.front().catch_votes);
  made.rule.of = static_cast<int>(rows.front().catch_of);
  const std::uint64_t last_to_calibrate = middle_seed(rows);
  std::vector<monitor::ChunkScores> usual;
  std::vector<const evidence::RolloutRow*> held_out;
  for (const evidence::RolloutRow& row : rows) {
    const bool nominal = row.perturbation == "none";
    if (row.seed > last_to_calibrate)
      held_out.push_back(&row);
    else if (nominal && row.success)
      usual.push_back(row.chunk_levels);
  }
  auto thresholds = calibrate(usual, scores, alarms);
  if (!thresholds) return std::unexpected(thresholds.error());
  made.calibrated_on = usual.size();
  made.rule.thresholds = std::move(*thresholds);
  for (const evidence::RolloutRow* const row : held_out) {
    const bool caught = is_caught(row->chunk_levels, made.rule.thresholds);
    ++(row->success ? made.successful : made.failed);
    if (!row->success && caught) ++made.failed_caught;
    if (row->perturbation != "none" || !row->success) continue;
    ++made.nominal;
    if (caught) ++made.nominal_caught;
  }
  for (std::size_t score = 0; score < config::kChunkScoreCount; ++score)
    made.auroc[score] = auroc_of(values_of(held_out, false, score), values_of(held_out, true, score));
  return made;
}

std::string detection_text(const ChunkDetection& detection) {
  std::string text = fmt::format(
      "chunk monitors, {} by {}: calibrated on {} nominal rollouts, judged on {} others of which {} failed\n"
      "  {:<16} {:>6}  {:<13} {:>9}\n",
      detection.task, detection.method, detection.calibrated_on, detection.failed + detection.successful,
      detection.failed, "score", "AUROC", "95 %", "threshold");
  for (std::size_t score = 0; score < config::kChunkScoreCount; ++score) {
    const auto& auroc = detection.auroc[score];
    const auto threshold = std::ranges::find(detection.rule.thresholds, static_cast<config::ChunkScore>(score),
                                             &config::ChunkThreshold::score);
    text +=
        fmt::format("  {:<16} {:>6}  {:<13} {:>9}\n", config::kChunkScoreNames[score],
                    auroc ? fmt::format("{:.3f}", auroc->area) : "-",
                    auroc ? fmt::format("{:.3f}..{:.3f}", auroc->low, auroc->high) : "-",
                    threshold != detection.rule.thresholds.end() ? fmt::format("{:.4g}", threshold->above) : "none");
  }
  return text + fmt::format("  any threshold: {} of {} failures caught, {} of {} nominal rollouts (false alarms)\n",
                            detection.failed_caught, detection.failed, detection.nominal_caught, detection.nominal);
}

}  // namespace takt::lab
