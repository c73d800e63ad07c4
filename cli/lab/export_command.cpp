// SPDX-License-Identifier: Apache-2.0
// takt export: runs in the forms that others train from.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/command.hpp"
#include "cli/lab_commands.hpp"
#include "config/printable.hpp"
#include "lab/data_set/lerobot_data_set.hpp"

namespace takt::cli {
namespace {

constexpr std::string_view kExport = "takt export lerobot";

struct LerobotOptions {
  std::vector<std::string> runs;
  std::string out, task;
};

std::optional<Refusal> refusal_of(const LerobotOptions& options) {
  std::error_code error;
  if (std::filesystem::exists(options.out, error))
    return Refusal{kExitUsage, fmt::format("{} exists already; name a folder that does not", options.out)};
  for (std::size_t one = 0; one < options.runs.size(); ++one) {
    for (std::size_t other = 0; other < one; ++other) {
      if (std::filesystem::equivalent(options.runs[one], options.runs[other], error))
        return Refusal{kExitUsage, fmt::format("{} is named twice", options.runs[one])};
    }
  }
  return std::nullopt;
}

std::expected<std::vector<data_set::RunEpisodes>, std::string> episodes_of(const std::vector<std::string>& folders) {
  std::vector<data_set::RunEpisodes> runs;
  for (const std::string& folder : folders) {
    const auto run = monitor::open_run(folder);
    if (!run) return std::unexpected(run.error());
    auto found = data_set::episodes_of(*run);
    if (!found) return std::unexpected(found.error());
    const std::string difference = runs.empty() ? "" : data_set::difference(runs.front().robot, found->robot);
    if (!difference.empty()) {
      return std::unexpected(fmt::format("{} and {} cannot stand in one data set: {}; export them apart",
                                         folders.front(), folder, difference));
    }
    runs.push_back(std::move(*found));
  }
  return runs;
}

std::size_t frames_in(const data_set::RunEpisodes& run) {
  std::size_t frames = 0;
  for (const data_set::Episode& episode : run.episodes) frames += episode.frames;
  return frames;
}

void say(const LerobotOptions& options, const std::vector<data_set::RunEpisodes>& runs) {
  std::size_t episodes = 0, frames = 0;
  for (std::size_t each = 0; each < runs.size(); ++each) {
    const std::size_t first = episodes;
    episodes += runs[each].episodes.size();
    frames += frames_in(runs[each]);
    fmt::print("{}: episodes {} to {}, {} frames; {} observations outside of them\n",
               config::printable(options.runs[each]), first, episodes - 1, frames_in(runs[each]),
               runs[each].observations - frames_in(runs[each]));
    if (runs[each].unreadable != 0)
      fmt::print("{}: {} damaged parts were left out\n", config::printable(options.runs[each]), runs[each].unreadable);
  }
  const Duration period = runs.front().robot.period;
  const std::int64_t fps = data_set::frames_per_second(period);
  if (fps * period.ns != 1'000'000'000) {
    fmt::print("a period of {} ms is no whole number of frames per second: fps and timestamps say {}\n",
               static_cast<double>(period.ns) * 1e-6, fps);
  }
  fmt::print("{}: {} episodes, {} frames, {} per second\n", config::printable(options.out), episodes, frames, fps);
}

int export_lerobot(const LerobotOptions& options) {
  if (const auto refusal = refusal_of(options))
    return refuse(refusal->exit_code, fmt::format("{}: {}", kExport, refusal->sentence));
  const auto runs = episodes_of(options.runs);
  if (!runs) return fail(kExport, runs.error());
  const data_set::Robot& robot = runs->front().robot;
  if (data_set::frames_per_second(robot.period) == 0)
    return fail(kExport,
                fmt::format("{}: a policy period of {} s is slower than the one frame per second of the format",
                            options.runs.front(), static_cast<double>(robot.period.ns) * 1e-9));
  const auto written = write_lerobot(*runs, options.task.empty() ? robot.name : options.task, options.out);
  if (!written) return fail(kExport, written.error());
  say(options, *runs);
  return kExitOk;
}

void add_lerobot(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("lerobot", "Write runs as a LeRobot data set, format v3.0.");
  auto options = std::make_shared<LerobotOptions>();
  command->add_option("RUN", options->runs, "run folders of one robot, in the order of their episodes")->required();
  command->add_option("--out", options->out, "folder to make, which must not exist")->required();
  command->add_option("--task", options->task, "what the robot did, in words; default: the robot's name");
  command->footer(
      "Every stretch in which the robot tracked its policy is an episode, every observation in it a frame:\n"
      "observation.state is q and dq of each joint, action what the policy asked for at that instant. Images are not\n"
      "exported (docs/reading-runs.md).\n"
      "Example: takt export lerobot runs/* --out arm6_reach --task \"follow the target\"\n"
      "Exit codes: 0 written; 1 a run cannot be read, was altered, has no policy or no tick that followed it, runs of\n"
      "different robots, the folder cannot be written; 64 the folder exists already, or a run is named twice.");
  command->callback([options, &exit_code] { exit_code = export_lerobot(*options); });
}

}  // namespace

void add_export(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "export");
  command->require_subcommand(1);
  add_lerobot(*command, exit_code);
}

}  // namespace takt::cli
