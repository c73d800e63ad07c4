// SPDX-License-Identifier: Apache-2.0
// takt run: options, what can be refused before anything starts, and the supervisor.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <expected>
#include <filesystem>
#include <memory>

#include "cli/command.hpp"
#include "cli/run/checked_robot.hpp"
#include "cli/run/own_process.hpp"
#include "cli/run/policy_check.hpp"
#include "cli/run/policy_host_option.hpp"
#include "cli/run/supervisor.hpp"
#include "cli/running_robots.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "config/printable.hpp"
#include "config/trouble/kinds.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "monitor/record/run_folder.hpp"
#include "simulation/scenario.hpp"

namespace takt::cli {
namespace {

std::string footer() {
  return fmt::format(
      "Example: takt run config/arm6.yaml --arm --duration 20s --at '8s: freeze policy 300ms' --at '15s: kill policy'\n"
      "Actions of --at: {}.\n"
      "PROCESS: {} (the run ends with the executive).\n"
      "The run ends after --duration, on SIGINT or SIGTERM, or once the robot rests after a scripted stop or kill of "
      "the policy.\n"
      "Exit codes: 0 ended as asked, 1 arming refused, a process failed, or what was scripted never happened, 2 ended "
      "in\na stop or fault that was not asked for: the last line says which; 64 command line, 65 configuration,\n"
      "69 a process or bus is missing or the executive answers nothing, 70 bug, 71 set-up refused (real time, "
      "permissions).",
      trouble::forms(trouble::Place::run), fmt::join(trouble::row_of(ActionKind::kill).strikes.words, ", "));
}

struct Given {
  std::string robot_file, runtime_dir, run_dir, duration, rearm_after, policy_host;
  std::vector<std::string> at, plant, policy, sensors;
  policy_host::Grants policy_may;
  bool arm = false, allow_non_realtime = false, restart = false, to_the_end = false;
};

std::string new_run_directory(const config::RobotConfig& robot) {
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  return robot.record.directory + "/" + monitor::new_run_id(robot.robot, since_epoch / std::chrono::nanoseconds(1));
}

// Nothing can move: real time is not worth a refusal.
bool only_simulated(const config::RobotConfig& robot) {
  return robot.simulation && std::ranges::none_of(robot.buses, [](const config::Bus& bus) {
           return bus.when_missing != config::WhenBusMissing::loopback ||
                  std::filesystem::exists("/sys/class/net/" + bus.interface);
         });
}

// What an event acts on, as the robot file names it; empty: every robot has it.
std::string missing_for(const Event& event, const config::RobotConfig& robot) {
  const bool is_own = event.action == ActionKind::freeze || event.action == ActionKind::kill ||
                      event.action == ActionKind::start || event.action == ActionKind::fault;
  if (!is_own) return {};
  if (event.process == ProcessName::plant && !robot.simulation) return "`simulation`";
  if (event.process == ProcessName::policy && !robot.policy) return "`policy`";
  if (event.process == ProcessName::fallback && config::fallback_policy_of(robot) == nullptr) return "fallback policy";
  return {};
}

// Does the robot have the processes that the script is about?
std::expected<void, Refusal> check_processes(const Given& given, const config::RobotConfig& robot,
                                             const std::vector<Event>& events) {
  for (const Event& event : events)
    if (const std::string missing = missing_for(event, robot); !missing.empty())
      return std::unexpected(Refusal{
          kExitUsage, fmt::format("{} would never happen: {} has no {}", as_given(event), given.robot_file, missing)});
  return {};
}

// Can the program that was named instead of takt-policy-host be started?
std::expected<void, Refusal> check_policy_host(const Given& given, const config::RobotConfig& robot) {
  if (given.policy_host.empty()) return {};
  if (!robot.policy)
    return std::unexpected(Refusal{kExitUsage, "--policy-host: " + given.robot_file + " has no `policy`"});
  std::error_code error;
  if (std::filesystem::is_regular_file(given.policy_host, error) && access(given.policy_host.c_str(), X_OK) == 0)
    return {};
  return std::unexpected(Refusal{
      kExitUnavailable,
      fmt::format("--policy-host {} cannot be executed: give the path of a program you may run", given.policy_host)});
}

// NAME=PROGRAM of each sensor that a program of the user's serves.
std::expected<std::vector<SensorProgram>, Refusal> sensor_programs(const Given& given,
                                                                   const config::RobotConfig& robot) {
  std::vector<SensorProgram> programs;
  const auto refused = [](const std::string& sentence) { return std::unexpected(Refusal{kExitUsage, sentence}); };
  for (const std::string& text : given.sensors) {
    const std::size_t equals = text.find('=');
    const std::string name = text.substr(0, equals);
    const std::string command = equals == std::string::npos ? "" : text.substr(equals + 1);
    const std::string option = "--sensor " + config::printable(text);
    if (name.empty() || command.find_first_not_of(' ') == std::string::npos)
      return refused(option + ": write NAME=PROGRAM, such as --sensor cam0=./camera.py");
    std::vector<std::string> known;
    for (const config::Sensor& sensor : robot.sensors) known.push_back(sensor.name);
    if (std::ranges::find(known, name) == known.end())
      return refused(fmt::format("{}: {} has no sensor {}; it has: {}", option, given.robot_file, name,
                                 known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", "))));
    if (robot.simulation && robot.simulation->camera_sensor == name)
      return refused(fmt::format("{}: takt-plant serves {} (simulation.camera)", option, name));
    if (std::ranges::find(programs, name, &SensorProgram::sensor) != programs.end())
      return refused(fmt::format("{}: a second program of {}; one serves a sensor", option, name));
    programs.push_back({name, command});
  }
  return programs;
}

// What takt-policy-host would refuse at its start, when plant, executive and monitor are running already.
std::expected<void, Refusal> check_policy(const Given& given, const config::RobotConfig& robot) {
  if (!given.policy_host.empty()) return {};
  const auto judged = in_own_process(
      [&]() -> std::expected<std::string, std::string> {
        const std::string refused = refused_by_policy_host(robot);
        if (!refused.empty()) return std::unexpected(refused);
        return "";
      },
      config::kExitBadConfiguration);
  if (!judged) return std::unexpected(judged.error());
  return {};
}

// A core that this machine lacks, or that is another robot's: two control threads of one priority on one core wait for
// each other.
void tell_wrong_core(const config::RobotConfig& robot) {
  if (!robot.control.cpu) return;
  if (const long cores = ::sysconf(_SC_NPROCESSORS_CONF); cores > 0 && *robot.control.cpu >= cores)
    note("note", fmt::format("control.cpu {}: this machine has cores 0 to {}; write one of these, or `cpu: none`",
                             *robot.control.cpu, cores - 1));
  for (const RunningRobot& other : running_robots(places_of_this_user()))
    if (what_runs_in(other.runtime_directory).cpu == robot.control.cpu)
      note("note", fmt::format("control.cpu {} is robot {}'s too: both come late; give each a core of its own",
                               *robot.control.cpu, other.name));
}

int run(const Given& given) {
  const auto checked = check_robot_file(given.robot_file);
  if (!checked) return refuse(config::kExitBadConfiguration, first_problems(checked.error()));
  const config::RobotConfig& robot = checked->robot;

  RunOptions options;
  options.arm = given.arm;
  options.restart = given.restart;
  options.to_the_end = given.to_the_end;
  // What another program than takt-policy-host takes for options is its own affair.
  auto events = parse_scenario(given.at, given.policy_host.empty() ? given.policy : std::vector<std::string>());
  if (!events) return refuse(kExitUsage, events.error());
  options.events = std::move(*events);
  options.plant_scenario = plant_scenario_of(given.plant);
  // What cannot be read is refused by the plant, in the same words as ever.
  if (const auto scenario = simulation::load_scenario(options.plant_scenario, robot);
      !options.plant_scenario.empty() && scenario)
    for (const simulation::FaultEvent& fault : scenario->events)
      options.plant_faults.push_back(fmt::format("{}: {}", fault.target_name, simulation::text_of(fault)));
  if (!given.duration.empty()) {
    const auto duration = parse_duration(given.duration);
    if (!duration) return refuse(kExitUsage, "--duration " + duration.error());
    options.duration = *duration;
    if (const auto fit = check_instants(options.events, *duration); !fit) return refuse(kExitUsage, fit.error());
  }
  if (!given.rearm_after.empty()) {
    const auto after = parse_duration(given.rearm_after);
    if (!after) return refuse(kExitUsage, "--rearm-after " + after.error());
    if (!robot.simulation)
      return refuse(kExitUsage, "--rearm-after is for simulated robots: " + given.robot_file + " has no `simulation`");
    options.rearm_after = *after;
  }
  options.place = {.robot_file = given.robot_file,
                   .runtime_directory =
                       given.runtime_dir.empty() ? config::default_runtime_directory(robot.robot) : given.runtime_dir,
                   .run_directory = given.run_dir.empty() ? new_run_directory(robot) : given.run_dir,
                   .allow_non_realtime = given.allow_non_realtime || only_simulated(robot),
                   .plant_arguments = given.plant,
                   .policy_host = given.policy_host,
                   .policy_arguments = given.policy,
                   .policy_grants = given.policy_may};
  auto sensors = sensor_programs(given, robot);
  if (!sensors) return refuse(sensors.error().exit_code, sensors.error().sentence);
  options.place.sensors = std::move(*sensors);
  if (const auto fine = check_processes(given, robot, options.events); !fine)
    return refuse(fine.error().exit_code, fine.error().sentence);
  if (const auto fine = check_policy_host(given, robot); !fine)
    return refuse(fine.error().exit_code, fine.error().sentence);
  if (std::filesystem::exists(options.place.run_directory))
    return refuse(kExitUsage,
                  fmt::format("--run-dir {} exists already; name a new folder", options.place.run_directory));
  if (ipc::ask(config::executive_socket(options.place.runtime_directory), OperatorVerb::status,
               std::chrono::milliseconds(500)))
    return refuse(kExitFailed, fmt::format("a robot already runs in {}; end it first or choose another --runtime-dir",
                                           options.place.runtime_directory));
  if (const auto fine = check_policy(given, robot); !fine)
    return fine.error().sentence.empty() ? fine.error().exit_code
                                         : refuse(fine.error().exit_code, fine.error().sentence);
  if (given.runtime_dir.empty())
    if (const auto home = make_runtime_home(config::runtime_home()); !home)
      return refuse(kExitUnavailable, home.error());
  remember_robot_file(options.place.runtime_directory, given.robot_file);
  tell_cautions(robot);
  tell_wrong_core(robot);
  return Supervisor(robot, std::move(options)).run();
}

}  // namespace

void add_run(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("run", "Start all processes of a robot, supervise them, and end them together.");
  auto given = std::make_shared<Given>();
  command->add_option("ROBOT", given->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", given->runtime_dir,
                      "where its sockets live; default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt");
  command->add_option("--run-dir", given->run_dir, "run folder to make; default: a new one in record.directory");
  command->add_option("--duration", given->duration, "end after this long, such as 20s");
  command->add_option("--at", given->at, "scripted event 'T: ACTION', T after tracking began")->allow_extra_args(false);
  command->add_option("--plant", given->plant, "a further option of takt-plant, such as --plant=--scenario=faults.yaml")
      ->allow_extra_args(false);
  command
      ->add_option("--policy", given->policy,
                   "a further option of the policy host, such as --policy=--fault='3 s for 1 s: publish_delay 100 ms'")
      ->allow_extra_args(false);
  command->add_option("--policy-host", given->policy_host,
                      "program to start instead of takt-policy-host: a policy in Python or C (docs/python-policy.md)");
  add_policy_may(*command, given->policy_may);
  command
      ->add_option(
          "--sensor", given->sensors,
          "NAME=PROGRAM: start the program that serves this sensor; with its options, quoted (docs/sensors.md)")
      ->allow_extra_args(false);
  command->add_flag("--to-the-end", given->to_the_end, "for the whole --duration, even if the robot rests before");
  command->add_flag("--arm", given->arm, "arm as soon as nothing is missing");
  command
      ->add_option("--rearm-after", given->rearm_after,
                   "end the robot's own stops and faults this long after they began, and arm again; simulated robots")
      ->needs("--arm");
  command->add_flag("--restart", given->restart,
                    "restart a policy host, monitor or sensor's program that died, at most once a second");
  command->add_flag("--allow-non-realtime", given->allow_non_realtime,
                    "run even without real-time guarantees; a simulated robot does anyway");
  command->footer(footer());
  command->callback([given, &exit_code] { exit_code = run(*given); });
}

}  // namespace takt::cli
