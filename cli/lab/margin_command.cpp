// SPDX-License-Identifier: Apache-2.0
// takt margin: how far the stabiliser is from instability, and how old a command the task tolerates.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab/progress.hpp"
#include "cli/lab_commands.hpp"
#include "cli/quantity_option.hpp"
#include "cli/run/checked_robot.hpp"
#include "cli/run/policy_host_option.hpp"
#include "cli/world_option.hpp"
#include "config/load.hpp"
#include "lab/study/margin_report.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct MarginOptions {
  std::string robot, svg, world, policy_host;
  policy_host::Grants policy_may;
  std::uint64_t seeds = 60;
  std::size_t workers = 1;
  double bound_mm = 20, safety = 0.8;
  bool has_bound = false;
  std::vector<double> command{0.5, 0, 0};  // m/s, m/s, rad/s
  bool no_task = false, json = false;
};

constexpr int kExitRings = 2;  // some joint's phase margin is below 30 degrees

struct TaskDefaults {
  double bound_m;
  Duration duration;
};

// A cart has a way to go when it is told another place, and a robot that walks sways about its way.
TaskDefaults defaults_of(evidence::Task task) {
  switch (task) {
    case evidence::Task::cart_pole_balance:
      return {0.4, seconds(12)};
    case evidence::Task::base_velocity:
      return {0.3, seconds(12)};
    case evidence::Task::arm_tracking:
    case evidence::Task::world:
      break;
  }
  return {0.02, seconds(8)};
}

std::expected<std::optional<study::AgeTolerance>, std::string> measure_task(const MarginOptions& options,
                                                                            const config::RobotConfig& robot) {
  if (options.no_task || !robot.policy) return std::nullopt;
  evidence::WorldProcess world(options.world);
  const auto task = evidence::task_of(robot, options.world.empty() ? nullptr : &world);
  if (!task) return std::unexpected(task.error());
  const TaskDefaults defaults = defaults_of(*task);
  Progress progress("rollouts at most");
  study::ToleranceSetup setup{
      .robot_file = options.robot,
      .task = *task,
      .seeds = options.seeds,
      .workers = options.workers,
      .safety = options.safety,
      .bound_m = options.has_bound ? options.bound_mm / 1e3 : defaults.bound_m,
      .duration = defaults.duration,
      .on_progress = [&](const study::ToleranceProgress& at) { progress.show(at.rollouts, at.at_most, at.dose); },
      .outside = {options.world, options.policy_host, options.policy_may}};
  std::ranges::copy(options.command, setup.base_velocity.command.begin());
  auto found = study::age_tolerance(setup);
  if (!found) return std::unexpected(found.error());
  return std::move(*found);
}

// Why nothing is said of the joints' loops; empty: it is.
std::string why_not_measured(const MarginOptions& options, const config::RobotConfig& robot) {
  if (std::string why = study::no_rest(robot); !why.empty()) return why;
  return robot.model || options.world.empty() ? "" : "another process plays its mechanics (--world)";
}

std::expected<std::vector<study::JointMargins>, std::string> measure_joints(const config::RobotConfig& robot) {
  Progress progress("joints");
  return study::joint_margins({.robot = robot,
                               .measured = robot,
                               .pose = study::home_pose(robot),
                               .on_joint = [&](std::size_t done, std::size_t of) { progress.show(done, of); }});
}

int run(const MarginOptions& options) {
  if (const std::string why = crowded_world(options.world, options.workers); !why.empty()) {
    fmt::print(stderr, "takt margin: {}\n", why);
    return kExitUsage;
  }
  const auto checked = check_robot_file(options.robot);
  if (!checked) {
    fmt::print(stderr, "{}\n", checked.error());
    return config::kExitBadConfiguration;
  }
  const config::RobotConfig& robot = checked->robot;
  const std::string not_measured = why_not_measured(options, robot);
  if (!not_measured.empty() && (options.no_task || !options.svg.empty()))
    return fail("takt margin", robot.file + ": " + not_measured + "; leave out --no-task and --svg");
  std::expected<std::vector<study::JointMargins>, std::string> joints;
  if (not_measured.empty()) joints = measure_joints(robot);
  if (!joints) return fail("takt margin", joints.error());
  if (!options.svg.empty() && std::ranges::none_of(*joints, &study::JointMargins::has_loop))
    return fail("takt margin", robot.file + ": no joint has a loop to draw; leave out --svg");
  if (!options.svg.empty())  // before the rollouts, which take minutes
    if (auto written = monitor::replace_file(options.svg, study::bode_svg(*joints)); !written)
      return fail("takt margin", written.error());
  auto task = measure_task(options, robot);
  if (!task) {
    // What was measured of the joints holds whatever the task does.
    const bool is_told = !options.json && !joints->empty();
    if (is_told) fmt::print("{}", study::margin_text({robot, std::move(*joints), std::nullopt, not_measured}));
    return fail("takt margin", task.error());
  }
  const study::MarginReport report{robot, std::move(*joints), std::move(*task), not_measured};
  fmt::print("{}", options.json ? json_line(study::to_json(report)) + "\n" : study::margin_text(report));
  for (const study::JointMargins& joint : report.joints)
    if (joint.rings()) fmt::print(stderr, "takt margin: {}\n", study::ringing_sentence(joint));
  if (!report.agrees()) return kExitFailed;
  return report.rings() ? kExitRings : kExitOk;
}

}  // namespace

void add_margin(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "margin");
  auto options = std::make_shared<MarginOptions>();
  command->add_option("ROBOT", options->robot, "robot file with a `simulation`")->required();
  command->add_flag("--no-task", options->no_task, "the stabiliser only, without the policy's rollouts");
  command->add_option("--seeds", options->seeds, "rollouts per dose; below 59 nothing can be shown")
      ->check(CLI::Range(std::uint64_t{study::kLeastSeeds}, std::uint64_t{100'000}));
  command->add_option("--workers", options->workers, "processes that share the rollouts; results do not depend on it")
      ->check(CLI::Range(1, 1024));
  CLI::Option* const bound =
      add_quantity(*command, "--bound", options->bound_mm, "mm",
                   "rms error that still is success; unless said 20 mm of an arm, 400 mm of a cart, 300 mm of a walker")
          ->check(CLI::PositiveNumber);
  command->add_option("--safety", options->safety, "share of what is tolerated that is proposed")
      ->check(CLI::Range(0.01, 1.0));
  command->add_option("--svg", options->svg, "also write the loops' Bode plot");
  command->add_option("--command", options->command, "of a robot that walks: m/s ahead, m/s and rad/s left")
      ->expected(3);
  add_world(*command, options->world);
  add_policy_host(*command, options->policy_host);
  add_policy_may(*command, options->policy_may);
  command->add_flag("--json", options->json, "print everything as one line of JSON (docs/margin.md)");
  command->footer(
      "Example: takt margin config/arm6.yaml --workers 2 --svg bode.svg\n"
      "Exit codes: 0 measured; 1 computed and injected margins differ by more than 10 %, the loop does not come to "
      "rest, or the task fails without any delay; 2 a joint rings: its phase margin is below 30 degrees;\n"
      "64 command line; 65 robot file.");
  command->callback([options, bound, &exit_code] {
    options->has_bound = bound->count() != 0;
    exit_code = run(*options);
  });
}

}  // namespace takt::cli
