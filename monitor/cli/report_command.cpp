// takt report: the freshness report of a run folder, in the terminal and as report.html.
#include <fmt/format.h>

#include <memory>

#include "config/load.hpp"
#include "monitor/bounded_file.hpp"
#include "monitor/cli/command.hpp"
#include "monitor/fault_classifier.hpp"
#include "monitor/report.hpp"

namespace takt::cli {
namespace {

struct Options {
  std::string directory, html;
  bool json = false;
};

int fail(const std::string& sentence) {
  fmt::print(stderr, "takt report: {}\n", sentence);
  return kExitFailed;
}

int report(const Options& options) {
  const auto run = monitor::open_run(options.directory);
  if (!run) return fail(run.error());
  const auto metrics = monitor::metrics_of(*run);
  if (!metrics) return fail(metrics.error());
  const auto series = monitor::series_of(*run, *metrics);
  if (!series) return fail(series.error());
  const auto faults = monitor::classify_run(*run);
  if (!faults) return fail(faults.error());
  const std::string path = options.html.empty() ? run->folder.report() : options.html;
  if (auto written = monitor::replace_file(path, monitor::report_html(*metrics, *series, *run)); !written) {
    return fail(written.error());
  }
  if (options.json) {
    auto json = monitor::to_json(*metrics, *run);
    json["faults"] = monitor::to_json(*faults);
    fmt::print("{}\n", json.dump());
  } else {
    fmt::print("{}{}charts        {}\n", monitor::report_text(*metrics, *run), monitor::fault_text(*faults), path);
  }
  return kExitOk;
}

}  // namespace

void add_report(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("report", "Show how fresh a run's commands were, and write report.html.");
  auto options = std::make_shared<Options>();
  command->add_option("DIR", options->directory, "run folder")->required();
  command->add_flag("--json", options->json, "print the metrics as one line of JSON (docs/report.md)");
  command->add_option("--html", options->html, "where to write the HTML report; default DIR/report.html");
  command->footer(
      "Example: takt report runs/20261121T093300Z-arm6-3f9a2c\n"
      "Exit codes: 0 reported, whatever the verdict; 1 not a run folder, or it cannot be read.");
  command->callback([options, &exit_code] { exit_code = report(*options); });
}

}  // namespace takt::cli
