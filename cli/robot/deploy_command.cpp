// SPDX-License-Identifier: Apache-2.0
// takt deploy: a robot file and its policy become what this machine runs, and go back if they do not stand the test.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/robot/deployed_robot.hpp"
#include "cli/robot/executive_guard.hpp"
#include "cli/run/checked_robot.hpp"
#include "cli/run/own_process.hpp"
#include "cli/run/policy_host_option.hpp"
#include "cli/run/scenario.hpp"
#include "cli/world_option.hpp"
#include "config/load.hpp"
#include "drivers/bus/socketcan_bus.hpp"
#include "systemd/deploy/smoke.hpp"
#include "systemd/deploy/store.hpp"

namespace takt::cli {
namespace {

struct DeployOptions : DeploymentOptions {
  std::string robot_file, name, world, policy_host, runs = "/var/lib/takt/runs", watch = "30s", arm_within = "120s";
  policy_host::Grants policy_may;
  bool simulated = false, arm = false;
  deploy::ProbationTimes times;  // of `watch` and `arm_within`
};

// What happened, for a person or a script.
struct Outcome {
  std::string name, previous, smoke, verdict, reason;  // verdict: proven, unproven, rolled_back
};

std::string new_name(const config::RobotConfig& robot) {
  return fmt::format("{:%Y%m%dT%H%M%SZ}-{}", fmt::gmtime(std::time(nullptr)), robot.robot);
}

std::unexpected<Refusal> refused(const std::string& sentence, int exit_code = kExitFailed) {
  return std::unexpected(Refusal{exit_code, sentence});
}

// Back to what ran before, or to nothing if nothing did.
std::expected<void, Refusal> go_back(deploy::Store& store, const DeployedRobot& place, const std::string& previous) {
  ask_to_stop(place);
  if (previous.empty())
    return refused("nothing was deployed before: the new deployment stays, and nothing vouches for it");
  if (const auto back = store.use(previous); !back) return refused("going back: " + back.error());
  deploy::WantedHosts wanted{.policy = false};
  if (const auto file = store.robot_file(previous); file)
    if (const auto robot = config::load(*file); robot) wanted = wanted_hosts(*robot);
  if (const auto restarted = restart_and_wait(place, wanted); !restarted)
    return refused(fmt::format("{} is in use again: {}", previous, restarted.error().sentence));
  return {};
}

// From here on the new robot is in use: every way out proves it, leaves it unproven, or goes back.
std::expected<void, Refusal> prove(deploy::Store& store, const DeployOptions& options, const config::RobotConfig& robot,
                                   Outcome& outcome) {
  const auto restarted = restart(options.place);
  Watched watched{deploy::Stage::unproven, "not restarted, so not watched: restart its processes yourself"};
  if (!restarted)
    watched = {deploy::Stage::failed, restarted.error().sentence};
  else if (!options.place.restart.empty())
    watched = watch(options.place, robot, options.times, options.arm);
  outcome.reason = watched.reason;
  if (watched.stage == deploy::Stage::failed) {
    outcome.verdict = "rolled_back";
    return go_back(store, options.place, outcome.previous);
  }
  outcome.verdict = watched.stage == deploy::Stage::passed ? "proven" : "unproven";
  if (watched.stage != deploy::Stage::passed) return {};
  if (const auto marked = store.mark_proven(outcome.name); !marked) return refused(marked.error());
  return {};
}

// Of the copy that would be used, and not of the files that it came from: those may change meanwhile.
std::expected<std::string, Refusal> smoke_run_of(const std::string& robot_file, const DeployOptions& options) {
  const auto robot = config::load(robot_file);
  if (!robot) return refused(robot.error());
  // What is restarted later must not inherit where a policy may run.
  return in_own_process(
      [&] {
        return deploy::smoke_run(*robot, {options.world, options.policy_host, options.policy_may});
      },
      // A world is no policy, and a program has a boundary of its own.
      kExitFailed, {.everything = !options.world.empty() || !options.policy_host.empty()});
}

void note_way_back(const deploy::Store& store, const std::string& runs, const Outcome& outcome) {
  const auto file = store.robot_file(store.current());
  const auto robot = file ? config::load(*file) : std::unexpected(file.error());
  note_deployment(runs, robot.value_or(config::RobotConfig{}),
                  {"rollback", outcome.name, store.current(), {}, {}, {}, "by takt deploy: " + outcome.reason});
}

std::expected<Outcome, Refusal> deploy_robot(const DeployOptions& options) {
  const auto checked = check_robot_file(options.robot_file);
  if (!checked) return refused(first_problems(checked.error()), config::kExitBadConfiguration);
  const config::RobotConfig& robot = checked->robot;
  const auto real = std::ranges::find_if(robot.buses, drivers::SocketCanBus::has_hardware, &config::Bus::interface);
  if (options.simulated && real != robot.buses.end())
    return refused(
        fmt::format("--simulated, but {} is a real CAN interface: the executive would command what hangs "
                    "there; name another interface in {}",
                    real->interface, options.robot_file));
  auto store = deploy::Store::open(options.store);
  if (!store) return refused(store.error());
  tell_cautions(robot);
  const std::vector<std::string> places{options.place.runtime_directory};
  if (const auto disarmed = require_disarmed(places); !disarmed) return std::unexpected(disarmed.error());

  Outcome outcome{options.name.empty() ? new_name(robot) : options.name, store->current(), {}, {}, {}};
  int exit_code = kExitFailed;
  const auto try_out = [&](const std::string& copy) -> std::expected<void, std::string> {
    auto smoke = smoke_run_of(copy, options);
    if (smoke) outcome.smoke = std::move(*smoke);
    if (smoke) return {};
    exit_code = smoke.error().exit_code;
    const std::string& why = smoke.error().sentence;
    return std::unexpected("smoke run failed, nothing was changed" + (why.empty() ? "" : ": " + why));
  };
  if (const auto added = store->add({robot, outcome.name, options.runs, options.simulated}, try_out); !added)
    return refused(added.error(), exit_code);
  // Again: the smoke run took seconds. From here on Ctrl-C goes back instead of ending half-way.
  catch_interruptions();
  if (const auto disarmed = require_disarmed(places); !disarmed) return std::unexpected(disarmed.error());
  if (const auto as_tried = store->is_as_tried(outcome.name); !as_tried) return refused(as_tried.error());
  if (const auto used = store->use(outcome.name); !used) return refused(used.error());
  note_deployment(options.runs, robot, {"deploy", outcome.previous, outcome.name, {}, {}, {}, "on probation"});
  const auto proven = prove(*store, options, robot, outcome);
  if (store->current() != outcome.name) note_way_back(*store, options.runs, outcome);
  if (!proven) return refused(fmt::format("{}: {}; {}", outcome.name, outcome.reason, proven.error().sentence));
  return outcome;
}

int report(const Outcome& outcome, bool json) {
  const bool rolled_back = outcome.verdict == "rolled_back";
  if (json)
    fmt::print("{}\n", json_line(nlohmann::ordered_json{{"deployment", outcome.name},
                                                        {"previous", outcome.previous},
                                                        {"smoke", outcome.smoke},
                                                        {"verdict", outcome.verdict},
                                                        {"reason", outcome.reason}}));
  else if (rolled_back)
    fmt::print(stderr, "{} was rolled back: {}. In use again: {}\n", outcome.name, outcome.reason, outcome.previous);
  else
    fmt::print("{} is in use, {}: {}. Smoke run: {}. Before: {}\n", outcome.name, outcome.verdict, outcome.reason,
               outcome.smoke, outcome.previous.empty() ? "nothing" : outcome.previous);
  return rolled_back ? kExitFailed : kExitOk;
}

int run(DeployOptions& options) {
  const auto watch_for = parse_duration(options.watch), arm_within = parse_duration(options.arm_within);
  if (!watch_for || !arm_within) {
    fmt::print(stderr, "takt deploy: {}\n",
               !watch_for ? "--watch " + watch_for.error() : "--arm-within " + arm_within.error());
    return kExitUsage;
  }
  options.times.watch = *watch_for;
  options.times.arm_within = *arm_within;
  settle_restart(options);
  if (options.place.restart.empty() && !options.no_restart) {
    fmt::print(stderr,
               "takt deploy: systemd does not run here: say how the robot's processes are started anew with "
               "--restart, or --no-restart\n");
    return kExitUnavailable;
  }
  const auto outcome = deploy_robot(options);
  if (outcome) return report(*outcome, options.json);
  fmt::print(stderr, "takt deploy: {}\n", outcome.error().sentence);
  return outcome.error().exit_code;
}

}  // namespace

void add_deploy(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("deploy", "Make a robot file and its policy what this machine runs, on probation.");
  auto options = std::make_shared<DeployOptions>();
  command->add_option("ROBOT", options->robot_file, "robot file")->required();
  command->add_option("--name", options->name, "of the deployment; default: UTC time and the robot's name");
  command->add_option("--watch", options->watch, "tracking for this long proves it")->capture_default_str();
  command->add_option("--arm-within", options->arm_within, "wait this long for an operator to arm it")
      ->capture_default_str();
  command->add_flag("--arm", options->arm, "arm it as soon as nothing is missing");
  command->add_flag("--simulated", options->simulated, "takt-plant plays the robot");
  command->add_option("--runs", options->runs, "record.directory of the deployment")->capture_default_str();
  add_world(*command, options->world);
  add_policy_host(*command, options->policy_host);
  add_policy_may(*command, options->policy_may);
  add_deployment_options(*command, *options);
  command->footer(
      "Example: sudo takt deploy robot.yaml --watch 60s\n"
      "Checks the file, copies it with its policy into a folder of its own, runs the copy for some seconds in virtual\n"
      "time if it has `simulation`, switches to it, restarts the robot's processes and watches: a degraded robot, "
      "a\n"
      "stop or a fault within --watch of tracking brings the previous deployment back. So does Ctrl-C. See takt\n"
      "rollback. /var/lib/takt/interventions keeps who deployed what (docs/duties.md). What a program of --policy-host "
      "imports is not copied: only the robot file and its policy files are.\n"
      "Exit codes: 0 in use, 1 refused or rolled back, 64 command line, 65 robot file, 69 nothing restarts it.");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace takt::cli
