// SPDX-License-Identifier: Apache-2.0
// takt report: the freshness report of a run folder, in the terminal and as report.html.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "config/printable.hpp"
#include "evidence/review/report/report_html.hpp"
#include "evidence/review/report/report_text.hpp"
#include "evidence/review/report/task_target.hpp"
#include "evidence/review/run_review.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct ReportOptions {
  std::string directory, html, against, truth;
  bool json = false;
};

// A file beside the run that tells nothing, as a simulator leaves it that was ended early, is no error.
std::string truth_file(const ReportOptions& options, const monitor::RecordedRun& run) {
  if (!options.truth.empty()) return options.truth;
  std::string beside = run.folder.path() + "/truth.jsonl";
  if (!std::filesystem::exists(beside)) return "";
  const auto target = evidence::TaskTarget::open(beside);
  if (target) return beside;
  fmt::print(stderr, "takt report: the playback shows no target: {}\n", target.error());
  return "";
}

std::expected<std::optional<evidence::RunComparison>, std::string> comparison_of(
    const ReportOptions& options, const nlohmann::ordered_json& metrics) {
  if (options.against.empty()) return std::nullopt;
  auto comparison = evidence::compare_with(metrics, options.against);
  if (!comparison) return std::unexpected(comparison.error());
  return std::move(*comparison);
}

int report(const ReportOptions& options) {
  const auto run = monitor::open_run(options.directory);
  if (!run) return fail("takt report", run.error());
  const auto review = evidence::review_of(*run);
  if (!review) return fail("takt report", review.error());
  const auto& [metrics, faults] = *review;
  auto json = monitor::to_json(metrics, *run);
  const auto comparison = comparison_of(options, json);
  if (!comparison) return fail("takt report", comparison.error());
  const auto series = evidence::series_of(*run, metrics, faults, truth_file(options, *run));
  if (!series) return fail("takt report", series.error());
  const std::string path = options.html.empty() ? run->folder.report() : options.html;
  const std::string page = evidence::report_html({*run, metrics, faults, *series, *comparison});
  const auto written = monitor::replace_file(path, page);
  if (options.json) {
    json["faults"] = monitor::to_json(faults);
    json["comparison"] = *comparison ? evidence::to_json(**comparison) : nullptr;
    fmt::print("{}\n", json_line(json));
  } else {
    fmt::print("{}{}{}", evidence::report_text(metrics, *run), evidence::faults_of_record(metrics, faults),
               *comparison ? evidence::comparison_text(**comparison) : "");
    if (written) fmt::print("page          {}\n", config::printable(path));
  }
  std::fflush(stdout);
  if (!written) return fail("takt report", written.error() + "; --html FILE writes the page elsewhere");
  return kExitOk;
}

}  // namespace

void add_report(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("report", "Show how fresh a run's commands were, and write report.html.");
  auto options = std::make_shared<ReportOptions>();
  command->add_option("DIR", options->directory, "run folder")->required();
  command->add_flag("--json", options->json, "print the metrics as one line of JSON (docs/report.md)");
  command->add_option("--html", options->html, "where to write the page; default DIR/report.html");
  command->add_option("--against", options->against, "run folder to compare with; default: none");
  command->add_option(
      "--truth", options->truth,
      "takt-plant's truth file, for the task's target in the playback; default DIR/truth.jsonl if there");
  command->footer(
      "Example: takt report runs/20261121T093300Z-arm6-3f9a2c --against runs/20261120T170210Z-arm6-99ab01\n"
      "Exit codes: 0 reported, whatever the verdict; 1 not a run folder, it cannot be read, or the page not written.");
  command->callback([options, &exit_code] { exit_code = report(*options); });
}

}  // namespace takt::cli
