// SPDX-License-Identifier: Apache-2.0
// takt doctor: what on this machine stands between a robot and a punctual control loop.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/command.hpp"
#include "cli/quantity_option.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_shelf.hpp"
#include "systemd/doctor/collect.hpp"
#include "systemd/doctor/diagnose.hpp"
#include "systemd/doctor/wakeup_probe.hpp"

namespace takt::cli {
namespace {

struct DoctorOptions {
  std::string robot_file;
  double seconds = 10;
  bool load = false, json = false, keep = false;
};

double hours_left(const config::RobotConfig& robot, std::uint64_t free_bytes) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const std::int64_t now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  return monitor::hours_left(monitor::runs_in(robot.record.directory, now_ns), robot, free_bytes);
}

// Where the runs go, so that the disk is the robot's.
std::string load_folder(const config::RobotConfig* robot) {
  if (robot != nullptr && std::filesystem::is_directory(robot->record.directory)) return robot->record.directory;
  return std::filesystem::current_path();
}

doctor::ProbePlan probe_plan(const config::RobotConfig* robot, const DoctorOptions& options) {
  doctor::ProbePlan plan{.length = Duration{std::llround(options.seconds * 1e9)},
                         .period = milliseconds(1),
                         .priority = 80,
                         .cpu = {},
                         .load_in = {}};
  if (options.load) plan.load_in = load_folder(robot);
  if (robot == nullptr) return plan;
  plan.period = robot->control.period;
  plan.priority = robot->control.priority;
  plan.cpu = robot->control.cpu;
  return plan;
}

bool kept(const std::string& verdict, const config::RobotConfig& robot) {
  // Made by us it would be ours, and the monitor could not write there.
  if (!std::filesystem::is_directory(robot.record.directory)) {
    fmt::print(stderr, "takt doctor: the verdict was not kept: {} is not there; run the robot once, or make it\n",
               robot.record.directory);
    return false;
  }
  const auto written = monitor::replace_file(config::doctor_verdict(robot.record.directory), verdict + "\n");
  if (!written) fmt::print(stderr, "takt doctor: the verdict was not kept: {}\n", written.error());
  return written.has_value();
}

int examine(const DoctorOptions& options) {
  std::optional<config::RobotConfig> robot;
  if (!options.robot_file.empty()) {
    auto loaded = config::load(options.robot_file);
    if (!loaded) {
      fmt::print(stderr, "{}\n", loaded.error());
      return config::kExitBadConfiguration;
    }
    robot = std::move(*loaded);
  }
  const config::RobotConfig* const known = robot ? &*robot : nullptr;
  doctor::Snapshot snapshot = doctor::collect({}, known);
  if (robot) snapshot.runs_hours_left = hours_left(*robot, snapshot.runs_free_bytes);
  if (options.seconds > 0) snapshot.wakeup = doctor::measure_wakeups(probe_plan(known, options));
  const auto findings = doctor::diagnose(snapshot, known);
  fmt::print("{}{}", options.json ? doctor::json_of(findings, snapshot) : doctor::text_of(findings, snapshot),
             options.json ? "\n" : "");
  if (options.keep && !kept(doctor::json_of(findings, snapshot), *robot)) return kExitFailed;
  return doctor::worst(findings) == doctor::Verdict::fail ? kExitFailed : kExitOk;
}

}  // namespace

void add_doctor(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("doctor", "Say whether this machine can do hard real time, and how to correct it.");
  auto options = std::make_shared<DoctorOptions>();
  CLI::Option* const robot = command->add_option("--robot", options->robot_file,
                                                 "robot file: its core, priority, CAN interfaces and disk too");
  add_quantity(*command, "--for", options->seconds, "s", "measure wake-ups this long (10s, 20min, 1h); 0: not at all")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_flag("--load", options->load, "load memory, disk and the other cores while measuring");
  command->add_flag("--json", options->json, "one line of JSON, schema takt.doctor/1");
  command
      ->add_flag("--keep", options->keep,
                 "keep the verdict as doctor.json in record.directory: the manifests of later runs quote it")
      ->needs(robot);
  command->footer(
      "Example: sudo takt doctor --robot robot.yaml --keep\n"
      "Measure while the machine does what it does when the robot runs, or with --load.\n"
      "Exit codes: 0 nothing failed (there may be warnings), 1 something did or could not be kept, 64 command line, 65 "
      "robot file.");
  command->callback([options, &exit_code] { exit_code = examine(*options); });
}

}  // namespace takt::cli
