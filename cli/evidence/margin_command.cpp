// takt margin: how far the stabiliser is from instability, and how old a command the task tolerates.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "cli/command.hpp"
#include "cli/policy_host_option.hpp"
#include "cli/quantity_option.hpp"
#include "cli/run/checked_robot.hpp"
#include "cli/world_option.hpp"
#include "config/load.hpp"
#include "evidence/study/margin_report.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct MarginOptions {
  std::string robot, svg, world, policy_host;
  std::uint64_t seeds = 60;
  std::size_t workers = 1;
  double bound_mm = 20, safety = 0.8;
  bool has_bound = false;
  std::vector<double> command{0.5, 0, 0};  // m/s, m/s, rad/s
  bool no_task = false, json = false;
};

// A robot that walks sways about its way; its velocity is judged over longer.
constexpr double kArmBound_m = 0.02, kWalkBound_m = 0.3;
constexpr Duration kArmRollout = seconds(8), kWalkRollout = seconds(12);

// On a terminal only: one line that is overwritten.
void show_progress(const std::string& sentence) {
  if (::isatty(STDERR_FILENO) == 1) fmt::print(stderr, "\r\x1b[K{}", sentence);
}

std::expected<std::optional<margin::AgeTolerance>, std::string> measure_task(const MarginOptions& options,
                                                                             const config::RobotConfig& robot) {
  if (options.no_task || !robot.policy) return std::nullopt;
  panel::WorldProcess world(options.world);
  const auto task = panel::task_of(robot, options.world.empty() ? nullptr : &world);
  if (!task) return std::unexpected(task.error());
  const bool walks = *task == panel::Task::base_velocity;
  margin::ToleranceSetup setup{.robot_file = options.robot,
                               .task = *task,
                               .seeds = options.seeds,
                               .workers = options.workers,
                               .safety = options.safety,
                               .bound_m = walks ? kWalkBound_m : kArmBound_m,
                               .duration = walks ? kWalkRollout : kArmRollout,
                               .on_progress = show_progress,
                               .outside = {options.world, options.policy_host}};
  std::ranges::copy(options.command, setup.base_velocity.command.begin());
  if (options.has_bound) setup.bound_m = options.bound_mm / 1e3;
  auto found = margin::age_tolerance(setup);
  if (!found) return std::unexpected(found.error());
  return std::move(*found);
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
  const auto on_joint = [](std::size_t done, std::size_t of) {
    show_progress(fmt::format("joint {} of {}", done, of));
  };
  std::expected<std::vector<margin::JointMargins>, std::string> joints;
  // Of a robot without mechanics of its own there is nothing to compute.
  const bool has_own = robot.model || robot.simulation->cart_pole || options.world.empty();
  if (panel::task_of(robot) != panel::Task::base_velocity && has_own)
    joints = margin::joint_margins(
        {.robot = robot, .measured = robot, .pose = margin::home_pose(robot), .on_joint = on_joint});
  else if (options.no_task || !options.svg.empty())
    return fail("takt margin", robot.file + ": " + margin::kNoInnerLoop + "; leave out --no-task and --svg");
  if (!joints) return fail("takt margin", joints.error());
  auto task = measure_task(options, robot);
  show_progress("");
  if (!task) return fail("takt margin", task.error());
  const margin::MarginReport report{robot, std::move(*joints), std::move(*task)};
  if (!options.svg.empty()) {
    if (auto written = monitor::replace_file(options.svg, margin::bode_svg(report.joints)); !written)
      return fail("takt margin", written.error());
  }
  fmt::print("{}", options.json ? margin::to_json(report).dump() + "\n" : margin::margin_text(report));
  return report.agrees() ? kExitOk : kExitFailed;
}

}  // namespace

void add_margin(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("margin", "Measure the stabiliser's margins and the command age that the task tolerates.");
  auto options = std::make_shared<MarginOptions>();
  command->add_option("ROBOT", options->robot, "robot file with a `simulation`")->required();
  command->add_flag("--no-task", options->no_task, "the stabiliser only, without the policy's rollouts");
  command->add_option("--seeds", options->seeds, "rollouts per dose; below 59 nothing can be shown")
      ->check(CLI::Range(std::uint64_t{margin::kLeastSeeds}, std::uint64_t{100'000}));
  command->add_option("--workers", options->workers, "processes that share the rollouts; results do not depend on it")
      ->check(CLI::Range(1, 1024));
  CLI::Option* const bound = add_quantity(*command, "--bound", options->bound_mm, "mm",
                                          "rms error that still is success; a robot that walks: 300 mm unless said")
                                 ->check(CLI::PositiveNumber);
  command->add_option("--safety", options->safety, "share of what is tolerated that is proposed")
      ->check(CLI::Range(0.01, 1.0));
  command->add_option("--svg", options->svg, "also write the loops' Bode plot");
  command->add_option("--command", options->command, "of a robot that walks: m/s ahead, m/s and rad/s left")
      ->expected(3);
  add_world(*command, options->world);
  add_policy_host(*command, options->policy_host);
  command->add_flag("--json", options->json, "print everything as one line of JSON (docs/margin.md)");
  command->footer(
      "Example: takt margin config/arm6.yaml --workers 2 --svg bode.svg\n"
      "Exit codes: 0 measured; 1 computed and injected margins differ by more than 10 %, the loop does not come to "
      "rest, "
      "or the task fails without any delay; 64 command line; 65 robot file.");
  command->callback([options, bound, &exit_code] {
    options->has_bound = bound->count() != 0;
    exit_code = run(*options);
  });
}

}  // namespace takt::cli
