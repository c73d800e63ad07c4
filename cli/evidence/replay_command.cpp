// SPDX-License-Identifier: Apache-2.0
// takt replay: does every recorded tick come out of the decision again, bit for bit?
#include <fmt/format.h>

#include <memory>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "evidence/review/replay.hpp"

namespace takt::cli {
namespace {

struct ReplayOptions {
  std::string directory;
  std::uint64_t from = 1;
  bool json = false;
};

int replay(const ReplayOptions& options) {
  const auto run = monitor::open_run(options.directory);
  if (!run) return fail("takt replay", run.error());
  const auto report = evidence::replay(*run, options.from);
  if (!report) return fail("takt replay", report.error());
  if (report->ticks == 0 && report->last_tick != 0)
    return fail("takt replay", fmt::format("--from {}: the run's last tick is {}", options.from, report->last_tick));
  if (options.json) {
    fmt::print("{}\n", json_line(evidence::to_json(*report)));
  } else {
    fmt::print("{}", evidence::replay_text(*report));
  }
  if (!report->reproduces()) return kExitFailed;
  return report->is_whole() ? kExitOk : kExitNotJudged;
}

}  // namespace

void add_replay(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("replay", "Feed a run's recorded inputs through the decision again.");
  auto options = std::make_shared<ReplayOptions>();
  command->add_option("DIR", options->directory, "run folder")->required();
  command->add_option("--from", options->from, "first tick to judge; replay starts at the keyframe before it")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt replay runs/20261121T093300Z-arm6-3f9a2c --from 12000\n"
      "Exit codes: 0 every tick reproduces bit for bit; 1 one does not (tick, field and both values are named), or\n"
      "nothing could be judged; 2 every judged tick does, but some could not be judged or are missing, or\n"
      "the recording was cut off.");
  command->callback([options, &exit_code] { exit_code = replay(*options); });
}

}  // namespace takt::cli
