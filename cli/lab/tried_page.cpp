// SPDX-License-Identifier: Apache-2.0
#include "cli/lab/tried_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

namespace takt::cli {
namespace {

using Rows = std::span<const TriedPolicy>;

// A table cell is one line without bars.
std::string table_cell(std::string text) {
  for (char& c : text) {
    if (c == '|' || static_cast<unsigned char>(c) < ' ') c = ' ';
  }
  return text;
}

bool loads(const TriedPolicy& row) {
  return row.trial.refusal.empty();
}

double ratio_of(const policy_trial::Agreement& agreement) {
  return agreement.own_us / agreement.judge_us;
}

// "1.2e-07". Infinite: one of the two says NaN or infinity where the other says a number.
std::string error_text(double error) {
  return std::isinf(error) ? "NaN or infinity against a number" : fmt::format("{:.1e}", error);
}

std::string row_of(const TriedPolicy& row, const std::string& name) {
  const policy_trial::Trial& trial = row.trial;
  std::string engine = trial.engine;
  if (!trial.why.empty()) engine += ": " + trial.why;
  if (!loads(row)) engine += (engine.empty() ? "none: " : " refuses: ") + trial.refusal;
  std::string error, time;
  if (row.agreement) {
    error = error_text(row.agreement->error);
    if (row.agreement->both_nan > 0) error += fmt::format(", both NaN {} times", row.agreement->both_nan);
    time = fmt::format("{:.1f}, {:.2f}", row.agreement->own_us, ratio_of(*row.agreement));
  } else if (!trial.unjudged.empty()) {
    error = "not judged: " + trial.unjudged;
  }
  return fmt::format("| {} | {} | {} | {} | {} |\n", table_cell(name), table_cell(engine), trial.values,
                     table_cell(error), time);
}

// "15 (time 0.35 to 0.98, median 0.82)": those that an engine runs.
std::string engine_text(Rows rows, const std::string& engine) {
  std::size_t count = 0;
  std::vector<double> ratios;
  for (const TriedPolicy& row : rows) {
    if (!loads(row) || row.trial.engine != engine) continue;
    ++count;
    if (row.agreement) ratios.push_back(ratio_of(*row.agreement));
  }
  if (ratios.empty()) return fmt::format("{} {}", engine, count);
  std::ranges::sort(ratios);
  return fmt::format("{} {} (time {:.2f} to {:.2f}, median {:.2f})", engine, count, ratios.front(), ratios.back(),
                     ratios[ratios.size() / 2]);
}

std::string summary_of(Rows rows) {
  std::set<std::string> engines;
  std::size_t loaded = 0, judged = 0;
  double error = 0;
  for (const TriedPolicy& row : rows) {
    if (!loads(row)) continue;
    ++loaded;
    engines.insert(row.trial.engine);
    if (!row.agreement) continue;
    ++judged;
    error = std::max(error, row.agreement->error);
  }
  std::string text = fmt::format("{} file{}, {} load", rows.size(), rows.size() == 1 ? "" : "s", loaded);
  if (judged > 0) text += fmt::format("; {} judged, error at most {}", judged, error_text(error));
  text += engines.empty() ? ".\n" : ":\n\n";
  for (const std::string& engine : engines) text += "- " + engine_text(rows, engine) + "\n";
  return text;
}

std::string folder_of(const TriedPolicy& row) {
  return row.file.has_parent_path() ? row.file.begin()->string() : std::string();
}

std::string table_of(Rows rows, const std::string& folder) {
  std::string text = "\n| policy | engine | values | error | us, ratio |\n|---|---|---|---|---|\n";
  for (const TriedPolicy& row : rows)
    text += row_of(row, folder.empty() ? row.file.string() : row.file.lexically_relative(folder).string());
  return text;
}

}  // namespace

std::string tried_page(Rows tried, const std::string& judge) {
  std::string text = "# Policies tried\n\n" + summary_of(tried) + "\n";
  text += judge.empty() ? std::string("Not judged: no ONNX Runtime was named (--onnxruntime).\n")
                        : fmt::format("Judge: ONNX Runtime {}, one thread.\n", judge);
  text += fmt::format(
      "\nEngine: what `policy.engine: auto` takes, and why where that is ONNX Runtime.\n"
      "Error: the largest |a - b| / max(1, |b|) of any output over {} observations in sequence, state fed back; of\n"
      "TorchScript its actions', against the ONNX file of the same name beside it.\n"
      "Time: medians of at most {} inferences; ratio: to ONNX Runtime's in turns, of `onnxruntime` to the bare "
      "library's.\n",
      policy_trial::kTrialObservations, kMostTimedInferences);
  const auto is_elsewhere = [&](const TriedPolicy& row) { return folder_of(row) != folder_of(tried.front()); };
  if (std::ranges::none_of(tried, is_elsewhere)) return text + table_of(tried, "");
  while (!tried.empty()) {
    const std::string folder = folder_of(tried.front());
    const auto end =
        std::ranges::find_if(tried, [&](const TriedPolicy& row) { return folder_of(row) != folder; }) - tried.begin();
    const Rows part = tried.first(static_cast<std::size_t>(end));
    text += fmt::format("\n## {}\n\n{}", folder.empty() ? "The folder itself" : folder, summary_of(part));
    text += table_of(part, folder);
    tried = tried.subspan(part.size());
  }
  return text;
}

}  // namespace takt::cli
