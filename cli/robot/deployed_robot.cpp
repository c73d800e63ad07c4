// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/deployed_robot.hpp"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "cli/run/external_tool.hpp"
#include "config/hash.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::cli {
namespace {

constexpr auto kReplyWithin = std::chrono::milliseconds(500);
constexpr long kProofPeriod_ns = 50'000'000;

volatile std::sig_atomic_t g_given_up = 0;

std::optional<StatusSnapshot> status_of(const DeployedRobot& robot) {
  const auto reply = ipc::ask(config::executive_socket(robot.runtime_directory), OperatorVerb::status, kReplyWithin);
  if (!reply) return std::nullopt;
  return reply->status;
}

void wait_a_little() {
  const timespec pause{0, kProofPeriod_ns};
  ::nanosleep(&pause, nullptr);
}

}  // namespace

void catch_interruptions() {
  g_given_up = 0;
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) std::signal(number, [](int) { g_given_up = 1; });
}

void add_deployment_options(CLI::App& command, DeploymentOptions& options) {
  command.add_option("--store", options.store, "where deployments are kept")->capture_default_str();
  command.add_option("--runtime-dir", options.place.runtime_directory, "where the robot's sockets are")
      ->capture_default_str();
  command.add_option("--restart", options.place.restart,
                     "command that starts its processes anew; default systemd's target");
  command.add_flag("--no-restart", options.no_restart, "only change what is in use at the next start");
  command.add_flag("--json", options.json, "one line of JSON");
}

void settle_restart(DeploymentOptions& options) {
  if (options.no_restart)
    options.place.restart.clear();
  else if (options.place.restart.empty() && std::filesystem::exists("/run/systemd/system"))
    options.place.restart = "systemctl reset-failed 'takt-*'; systemctl restart takt.target";
}

void note_deployment(const std::string& runs, const config::RobotConfig& robot, monitor::Deployment deployment) {
  const std::string folder = monitor::intervention_folder(runs);
  monitor::InterventionLog log(folder);
  if (!log.is_kept())
    note("note", fmt::format("not in a log of interventions: there is no folder {} (docs/duties.md)", folder));
  deployment.robot = robot.robot;
  deployment.config_sha256 = robot.sha256;
  if (robot.policy) deployment.policy = config::policy_sha256(robot.policy->file).value_or("");
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  log.note(deployment, std::chrono::nanoseconds(now).count());
  if (!log.failure().empty()) note("warning", "an intervention is not in the log: " + log.failure());
}

std::expected<void, Refusal> restart(const DeployedRobot& robot) {
  if (robot.restart.empty()) return {};
  ToolResult result = run_tool({"sh", "-c", robot.restart});
  if (result.exit_code == 0) return {};
  result.output.erase(result.output.find_last_not_of(" \n") + 1);
  return std::unexpected(
      Refusal{kExitFailed, fmt::format("`{}` ended with {}: {}", robot.restart, result.exit_code, result.output)});
}

deploy::WantedHosts wanted_hosts(const config::RobotConfig& robot) {
  return {.policy = robot.policy.has_value(), .fallback = config::fallback_policy_of(robot) != nullptr};
}

Watched watch(const DeployedRobot& place, const config::RobotConfig& robot, const deploy::ProbationTimes& times,
              bool arm) {
  deploy::Probation probation(times, wanted_hosts(robot), place.runtime_directory);
  const MonoTime started = monotonic_now();
  while (g_given_up == 0) {
    const deploy::Stage stage = probation.look(monotonic_now() - started, status_of(place));
    if (deploy::is_over(stage)) return {stage, probation.reason()};
    // Refused as long as something is missing; `arm_within` bounds how often this is asked.
    if (arm && stage == deploy::Stage::waiting)
      (void)ipc::ask(config::executive_socket(place.runtime_directory), OperatorVerb::arm, kReplyWithin);
    wait_a_little();
  }
  return {deploy::Stage::failed, "interrupted"};
}

std::expected<void, Refusal> restart_and_wait(const DeployedRobot& robot, deploy::WantedHosts wanted) {
  if (const auto restarted = restart(robot); !restarted || robot.restart.empty()) return restarted;
  deploy::Probation probation({}, wanted, robot.runtime_directory);
  const MonoTime started = monotonic_now();
  for (;; wait_a_little()) {
    const deploy::Stage stage = probation.look(monotonic_now() - started, status_of(robot));
    if (stage == deploy::Stage::failed)
      return std::unexpected(Refusal{kExitFailed, fmt::format("restarted, but {}", probation.reason())});
    if (stage != deploy::Stage::starting) return {};
  }
}

void ask_to_stop(const DeployedRobot& robot) {
  (void)ipc::ask(config::executive_socket(robot.runtime_directory), OperatorVerb::stop, kReplyWithin);
}

}  // namespace takt::cli
