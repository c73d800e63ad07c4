// SPDX-License-Identifier: Apache-2.0
// takt ablate: which protection costs what on this robot.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab/progress.hpp"
#include "cli/lab_commands.hpp"
#include "cli/quantity_option.hpp"
#include "cli/run/checked_robot.hpp"
#include "config/load.hpp"
#include "lab/study/ablation.hpp"

namespace takt::cli {
namespace {

struct AblateOptions {
  std::string robot;
  std::uint64_t seeds = 20;
  std::size_t workers = 1;
  double bound_mm = 0;                     // 0: the task's own
  std::vector<double> command{0.5, 0, 0};  // m/s, m/s, rad/s
  bool json = false;
};

// As in config/panels/harm.yaml.
double bound_of(evidence::Task task) {
  switch (task) {
    case evidence::Task::cart_pole_balance:
      return 0.4;
    case evidence::Task::base_velocity:
      return 0.15;
    case evidence::Task::arm_tracking:
    case evidence::Task::world:
      break;
  }
  return 0.02;
}
constexpr Duration kWalksUntil = seconds(8);

int run(const AblateOptions& options) {
  const auto checked = check_robot_file(options.robot);
  if (!checked) return refuse(config::kExitBadConfiguration, checked.error());
  const evidence::Task task = evidence::task_of(checked->robot);
  std::optional<Progress> progress("rollouts");
  study::AblationSetup setup{.robot_file = options.robot,
                             .task = task,
                             .seeds = options.seeds,
                             .workers = options.workers,
                             .bound_m = options.bound_mm > 0 ? options.bound_mm / 1e3 : bound_of(task),
                             .on_progress = [&](std::size_t done, std::size_t of) { progress->show(done, of); }};
  std::ranges::copy(options.command, setup.base_velocity.command.begin());
  setup.base_velocity.until = kWalksUntil;
  const auto found = study::ablate(setup);
  progress.reset();
  if (!found) return fail("takt ablate", found.error());
  fmt::print("{}", options.json ? json_line(study::to_json(*found)) + "\n" : study::ablation_text(*found));
  return kExitOk;
}

}  // namespace

void add_ablate(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "ablate");
  auto options = std::make_shared<AblateOptions>();
  command->add_option("ROBOT", options->robot, "robot file with a `simulation` and a policy")->required();
  command->add_option("--seeds", options->seeds, "rollouts per line")->check(CLI::Range(1, 100'000));
  command->add_option("--workers", options->workers, "processes that share the rollouts; results do not depend on it")
      ->check(CLI::Range(1, 1024));
  add_quantity(*command, "--bound", options->bound_mm, "mm",
               "rms error that still is success; else 20 mm of an arm, 400 mm of a cart, 150 mm of a robot that walks")
      ->check(CLI::PositiveNumber);
  command->add_option("--command", options->command, "of a robot that walks: m/s ahead, m/s and rad/s left")
      ->expected(3);
  command->add_flag("--json", options->json, "print one line of JSON instead of the tables (docs/panels.md)");
  command->footer(
      "Example: takt ablate config/arm6.yaml --workers 2\n"
      "Exit codes: 0 measured; 1 a rollout could not be run; 64 command line; 65 robot file.");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace takt::cli
