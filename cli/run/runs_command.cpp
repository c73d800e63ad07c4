// SPDX-License-Identifier: Apache-2.0
// takt runs: what lies in the folder of the runs, and what of it stays.
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/command.hpp"
#include "config/load.hpp"
#include "config/printable.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/record/run_shelf.hpp"

namespace takt::cli {
namespace {

std::int64_t unix_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string length_text(double seconds) {
  const auto whole = static_cast<std::uint64_t>(seconds);
  return fmt::format("{}:{:02}:{:02}", whole / 3'600, whole / 60 % 60, whole % 60);
}

double gib(std::uint64_t bytes) {
  return static_cast<double>(bytes) / (1U << 30U);
}

int list(const std::string& place) {
  std::string directory = place;
  if (std::error_code error; !std::filesystem::is_directory(place, error)) {
    const auto robot = config::load(place);
    if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
    directory = robot->record.directory;
  }
  std::uint64_t bytes = 0;
  const auto runs = monitor::runs_in(directory, unix_ns());
  for (const monitor::ShelvedRun& run : runs) {
    bytes += run.bytes;
    fmt::print("{}  {}  {:>9}  {:>8.3f} GiB  {}{}\n", config::printable(run.name),
               monitor::utc_text(run.began_unix_ns).substr(0, 19) + "Z", length_text(run.seconds), gib(run.bytes),
               run.is_kept ? "kept; " : "", config::printable(run.ended));
  }
  fmt::print("{} runs, {:.1f} GiB in {}\n", runs.size(), gib(bytes), config::printable(directory));
  return kExitOk;
}

int keep(const std::vector<std::string>& folders) {
  for (const std::string& folder : folders)
    if (const auto kept = monitor::keep_run(folder); !kept) return fail("takt runs keep", kept.error());
  return kExitOk;
}

int prune(const std::string& robot_file) {
  const auto robot = config::load(robot_file);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  if (!robot->record.keep.is_given())
    return refuse(kExitUsage, fmt::format("takt runs prune: {} keeps every run; write record.keep, such as "
                                          "`keep: {{ days: 30, gib: 200 }}`",
                                          robot_file));
  std::uint64_t bytes = 0;
  auto runs = monitor::runs_in(robot->record.directory, unix_ns());
  const auto pruned = monitor::prune(runs, *robot, unix_ns());
  for (const monitor::ShelvedRun& run : pruned.gone) {
    bytes += run.bytes;
    fmt::print("deleted {}\n", config::printable(run.folder));
  }
  fmt::print("{} runs deleted, {:.1f} GiB\n", pruned.gone.size(), gib(bytes));
  int exit_code = kExitOk;
  for (const std::string& failure : pruned.failures) exit_code = fail("takt runs prune", failure);
  return exit_code;
}

}  // namespace

void add_runs(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("runs", "List run folders, keep some for ever, delete old ones.");
  command->require_subcommand(1);
  command->footer(
      "A robot's monitor deletes what `record.keep` of its file does not keep (docs/run-folder.md).\n"
      "Exit codes: 0 done, 1 not a run folder, or it cannot be written or deleted, 64 usage, 65 configuration.");

  auto place = std::make_shared<std::string>();
  CLI::App* lists = command->add_subcommand("list", "Show name, beginning, length, size and end of each run.");
  lists->add_option("PLACE", *place, "robot file, or the folder that holds run folders")->required();
  lists->footer("Example: takt runs list /var/lib/takt/runs\nExit codes: 0 listed, 64 usage, 65 configuration.");
  lists->callback([place, &exit_code] { exit_code = list(*place); });

  auto folders = std::make_shared<std::vector<std::string>>();
  CLI::App* keeps = command->add_subcommand("keep", "Never delete these runs; removing RUN/kept takes it back.");
  keeps->add_option("RUN", *folders, "run folders")->required();
  keeps->footer(
      "Example: takt runs keep runs/20261121T093300Z-arm6-3f9a2c\nExit codes: 0 kept, 1 not a run folder, or it cannot "
      "be written, 64 usage.");
  keeps->callback([folders, &exit_code] { exit_code = keep(*folders); });

  auto robot_file = std::make_shared<std::string>();
  CLI::App* prunes = command->add_subcommand("prune", "Delete now what `record.keep` of a robot file does not keep.");
  prunes->add_option("ROBOT", *robot_file, "robot file")->required();
  prunes->footer(
      "Example: takt runs prune config/arm6.yaml\nExit codes: 0 done, 1 a run cannot be deleted, 64 usage, or the "
      "file keeps every run, 65 configuration.");
  prunes->callback([robot_file, &exit_code] { exit_code = prune(*robot_file); });
}

}  // namespace takt::cli
