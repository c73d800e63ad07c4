// SPDX-License-Identifier: Apache-2.0
// takt policy calibrate: what is usual in a policy's answers, as thresholds for its chunk monitors.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/lab/progress.hpp"
#include "cli/lab_commands.hpp"
#include "cli/quantity_option.hpp"
#include "config/load.hpp"
#include "evidence/review/usual_stretches.hpp"
#include "lab/artifact/artifact.hpp"
#include "lab/judge/chunk_detection.hpp"

namespace takt::cli {
namespace {

struct CalibrateArguments {
  std::vector<std::string> directories, scores;
  std::string task, method;
  double alarms = 0.05;
  double stretch_s = 10;
};

std::vector<config::ChunkScore> scores_of(const CalibrateArguments& arguments) {
  std::vector<config::ChunkScore> scores;
  for (const std::string& word : arguments.scores)
    scores.push_back(static_cast<config::ChunkScore>(std::ranges::find(config::kChunkScoreNames, word) -
                                                     config::kChunkScoreNames.begin()));
  return scores;
}

void print_monitors(const config::ChunkMonitors& rule, const std::string& remark) {
  fmt::print("# {}\nmonitors: # below `policy`\n  votes: {}\n  of: {}\n  thresholds:\n", remark, rule.votes, rule.of);
  for (const config::ChunkThreshold& one : rule.thresholds)
    fmt::print("    - {{ score: {}, above: {} }}\n", name(one.score), one.above);
}

config::ChunkMonitors rule_of(const monitor::RecordedRun& run) {
  return run.robot.policy ? run.robot.policy->monitors.value_or(config::ChunkMonitors{}) : config::ChunkMonitors{};
}

int from_artifact(const CalibrateArguments& arguments) {
  constexpr std::string_view command = "takt policy calibrate";
  const auto artifact = lab::open_artifact(arguments.directories.front());
  if (!artifact) return fail(command, artifact.error());
  std::vector<evidence::RolloutRow> rows;
  for (const evidence::RolloutRow& row : artifact->rows)
    if ((arguments.task.empty() || row.task == arguments.task) &&
        (arguments.method.empty() || row.method == arguments.method))
      rows.push_back(row);
  const bool one_kind = std::ranges::all_of(rows, [&](const evidence::RolloutRow& row) {
    return row.task == rows.front().task && row.method == rows.front().method;
  });
  if (!one_kind)
    return refuse(kExitUsage, std::string(command) +
                                  ": the rows are of several tasks or methods; name one with --task and --method");
  const auto detection = lab::detection_of(rows, scores_of(arguments), arguments.alarms);
  if (!detection) return fail(command, detection.error());
  print_monitors(detection->rule, fmt::format("at most {:g} of nominal rollouts like the {} calibrated on have a catch",
                                              arguments.alarms, detection->calibrated_on));
  fmt::print(stderr, "{}", lab::detection_text(*detection));
  return kExitOk;
}

// Levels of runs can be put together where the same policy was watched by the same rule on the same robot.
std::string misfit(const monitor::RecordedRun& run, const monitor::RecordedRun& first) {
  if (run.manifest.robot != first.manifest.robot) return "another robot";
  if (run.manifest.policy_sha256 != first.manifest.policy_sha256) return "another policy";
  const config::ChunkMonitors rule = rule_of(run), first_rule = rule_of(first);
  if (rule.votes != first_rule.votes || rule.of != first_rule.of) return "another number of votes";
  return "";
}

int from_runs(const CalibrateArguments& arguments) {
  constexpr std::string_view command = "takt policy calibrate";
  std::vector<monitor::ChunkScores> usual;
  std::optional<monitor::RecordedRun> first;
  std::optional<Progress> progress("runs");
  std::size_t read = 0;
  for (const std::string& directory : arguments.directories) {
    auto run = monitor::open_run(directory);
    if (!run) return fail(command, run.error());
    if (first) {
      if (const std::string why = misfit(*run, *first); !why.empty())
        return fail(command, fmt::format("{} is of {} than {}; calibrate them apart", directory, why,
                                         arguments.directories.front()));
    }
    const auto levels = evidence::usual_stretches(*run, Duration{std::llround(arguments.stretch_s * 1e9)});
    if (!levels) return fail(command, levels.error());
    usual.insert(usual.end(), levels->begin(), levels->end());
    if (!first) first = std::move(*run);
    progress->show(++read, arguments.directories.size());
  }
  progress.reset();
  auto thresholds = lab::calibrate(usual, scores_of(arguments), arguments.alarms);
  if (!thresholds) return fail(command, thresholds.error());
  config::ChunkMonitors rule = rule_of(*first);
  rule.thresholds = std::move(*thresholds);
  print_monitors(rule, fmt::format("at most {:g} of stretches of {:g} s like the {} calibrated on have a catch",
                                   arguments.alarms, arguments.stretch_s, usual.size()));
  return kExitOk;
}

int calibrate(const CalibrateArguments& arguments) {
  if (!(arguments.stretch_s >= 0.1 && arguments.stretch_s <= 3600))
    return refuse(kExitUsage, "takt policy calibrate: --stretch is a time from 0.1 s to 1 h");
  if (std::set(arguments.scores.begin(), arguments.scores.end()).size() != arguments.scores.size())
    return refuse(kExitUsage, "takt policy calibrate: --scores names a score twice");
  const bool of_panel = std::filesystem::exists(lab::ArtifactFolder(arguments.directories.front()).rows());
  if (!of_panel) return from_runs(arguments);
  if (arguments.directories.size() == 1) return from_artifact(arguments);
  return refuse(kExitUsage,
                "takt policy calibrate: one panel's folder, or runs; not several folders of which one is a panel's");
}

}  // namespace

void add_policy_calibrate(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "calibrate");
  auto arguments = std::make_shared<CalibrateArguments>();
  arguments->scores = {"temporal_error", "reversals", "jerk", "inefficiency", "stall"};
  command->add_option("DIR", arguments->directories, "run folders in which all went well, or one panel's folder")
      ->required();
  command->add_option("--scores", arguments->scores, "to watch, separated by commas")
      ->delimiter(',')
      ->capture_default_str()
      ->check(
          CLI::IsMember(std::vector<std::string>(config::kChunkScoreNames.begin(), config::kChunkScoreNames.end())));
  command->add_option("--alarms", arguments->alarms, "share of stretches without a fault that may have a catch")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 1.0));
  add_quantity(*command, "--stretch", arguments->stretch_s, "s", "runs are cut into stretches of this length");
  command->add_option("--task", arguments->task, "of a panel with several");
  command->add_option("--method", arguments->method, "of a panel with several");
  command->footer(
      "Example: takt policy calibrate runs/* --alarms 0.05\n"
      "Exit codes: 0 thresholds printed, as YAML for the robot file; 1 a folder cannot be read, holds too little,\n"
      "or is of another robot or policy than the first;\n"
      "64 command line.");
  command->callback([arguments, &exit_code] { exit_code = calibrate(*arguments); });
}

}  // namespace takt::cli
