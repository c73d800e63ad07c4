// SPDX-License-Identifier: Apache-2.0
// The robot that a store's deployments run as: whether it may be replaced now, restarting its processes, and watching
// them. Shared by takt deploy and takt rollback. Thread rule: one thread.
#pragma once

#include <expected>
#include <string>

#include "cli/command.hpp"
#include "config/robot_config.hpp"
#include "monitor/record/intervention_log.hpp"
#include "systemd/deploy/probation.hpp"

namespace takt::cli {

struct DeployedRobot {
  std::string runtime_directory;
  std::string restart;  // shell command that starts its processes anew; empty: none does
};

// What takt deploy and takt rollback are both told.
struct DeploymentOptions {
  std::string store = "/etc/takt";
  DeployedRobot place{"/run/takt", {}};
  bool no_restart = false, json = false;
};
// `options` outlives the parsing.
void add_deployment_options(CLI::App& command, DeploymentOptions& options);
// After parsing: what restarts it by default: systemd's target, where systemd runs; else, or with --no-restart,
// nothing.
void settle_restart(DeploymentOptions& options);

// Into the log of interventions beside `runs` (monitor/record/intervention_log.hpp). No log, or a line that cannot be
// written, is a line on stderr. `robot`: of what is in use now.
void note_deployment(const std::string& runs, const config::RobotConfig& robot, monitor::Deployment deployment);

// From now on SIGINT, SIGTERM and SIGHUP end what waits below, not the process.
void catch_interruptions();

// The hosts that this robot's file asks for.
deploy::WantedHosts wanted_hosts(const config::RobotConfig& robot);

// Runs the restart command; the error says how it ended.
std::expected<void, Refusal> restart(const DeployedRobot& robot);
// The same, and waits until the executive answers and has its monitor and the hosts that are wanted.
// Interruptions are ignored: this is the way back.
std::expected<void, Refusal> restart_and_wait(const DeployedRobot& robot, deploy::WantedHosts wanted);

// Polls the executive until the probation is over, or an interruption was caught: failed. `arm`: arms it as soon as it
// will. `robot`: the new one.
struct Watched {
  deploy::Stage stage = deploy::Stage::failed;
  std::string reason;
};
Watched watch(const DeployedRobot& place, const config::RobotConfig& robot, const deploy::ProbationTimes& times,
              bool arm);

// A damped stop, if it is armed; no error when no executive answers.
void ask_to_stop(const DeployedRobot& robot);

}  // namespace takt::cli
