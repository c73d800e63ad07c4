// SPDX-License-Identifier: Apache-2.0
// takt panel attest: what a panel showed of one way in which a robot is to stay on its feet, as a file for `shown_by`.
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "cli/command.hpp"
#include "config/load.hpp"
#include "evidence/attestation/attestation.hpp"
#include "lab/judge/attest.hpp"
#include "lab/panel/panel_file.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct AttestOptions {
  std::string directory, robot_file, of, method, out;
};

std::expected<std::string, std::string> method_of(const AttestOptions& options, const lab::Panel& panel) {
  if (options.method.empty() && panel.methods.size() == 1) return panel.methods.front().name;
  const auto found = std::ranges::find(panel.methods, options.method, &lab::PanelMethod::name);
  if (found != panel.methods.end()) return found->name;
  std::string names;
  for (const lab::PanelMethod& method : panel.methods) names += (names.empty() ? "" : ", ") + method.name;
  return std::unexpected(fmt::format("--method is one of {}", names));
}

// As that method ran it.
std::expected<config::RobotConfig, std::string> robot_of(const AttestOptions& options, const lab::PanelTask& task,
                                                         const lab::Panel& panel, const std::string& method) {
  auto robot = config::load(options.robot_file);
  if (robot && !task.overrides.empty()) robot = config::with_overrides(*robot, task.overrides);
  const auto found = std::ranges::find(panel.methods, method, &lab::PanelMethod::name);
  if (robot && !found->overrides.empty()) robot = config::with_overrides(*robot, found->overrides);
  return robot;
}

int attest(const AttestOptions& options) {
  constexpr const char* kCommand = "takt panel attest";
  const auto artifact = lab::open_finished_artifact(options.directory);
  if (!artifact) return fail(kCommand, artifact.error());
  const auto panel = lab::load_panel(artifact->folder.panel());
  if (!panel) return fail(kCommand, panel.error());
  if (panel->sha256 != artifact->manifest.panel_sha256)
    return fail(kCommand, artifact->folder.panel() + ": not the panel that the rows were computed from");
  const auto method = method_of(options, *panel);
  if (!method) return refuse(kExitUsage, fmt::format("{}: {}", kCommand, method.error()));
  const auto task = std::ranges::find(panel->tasks, evidence::Task::base_velocity, &lab::PanelTask::task);
  if (task == panel->tasks.end())
    return fail(kCommand, options.directory + ": no task of this panel tells whether a robot fell (base_velocity)");
  const auto robot = robot_of(options, *task, *panel, *method);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  const auto made = lab::attest(*artifact, panel->text, *robot, options.of, *method,
                                {task->base_velocity.least_height, task->base_velocity.most_tilt});
  if (!made) return fail(kCommand, made.error());
  if (const std::string why = evidence::shortcoming(*made, *robot, options.of); !why.empty())
    return fail(kCommand, fmt::format("{} is not shown: {}", options.of, why));
  if (const auto done = monitor::replace_file(options.out, evidence::attestation_text(*made)); !done)
    return fail(kCommand, done.error());
  fmt::print("{}: {}\n", options.of, evidence::what_it_shows(*made));
  return kExitOk;
}

}  // namespace

void add_panel_attest(CLI::App& panel, int& exit_code) {
  CLI::App* command =
      panel.add_subcommand("attest", "Write what a panel showed of a stop or fallback that a robot is to stand by.");
  auto options = std::make_shared<AttestOptions>();
  command->add_option("DIR", options->directory, "artifact folder")->required();
  command->add_option("--robot", options->robot_file, "the robot file that the panel ran")->required();
  command->add_option("--of", options->of, "stops.CAUSE or fallbacks.NAME of that file")->required();
  command->add_option("--method", options->method, "of the panel; not needed where it has one");
  command->add_option("--out", options->out, "file to write: what `shown_by` of the robot file names")->required();
  command->footer(
      "Example: takt panel attest runs/stops --robot config/balancer.yaml --of stops.operator_stop "
      "--out config/shown/balancer.operator_stop.json\n"
      "Exit codes: 0 written; 1 the rows do not show it, with the reason; 64 command line; 65 robot file.");
  command->callback([options, &exit_code] { exit_code = attest(*options); });
}

}  // namespace takt::cli
