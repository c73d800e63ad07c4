// SPDX-License-Identifier: Apache-2.0
// What the programs of one robot do alike: options, version, signals, log, refusals, exit codes.
// Thread rule: main thread, before there is another one.
#pragma once

#include <sys/types.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <expected>
#include <functional>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/exit_codes.hpp"

namespace takt::program {

struct RobotOptions {
  std::string robot, runtime_directory, policy_user;
};

// --robot FILE: `what`; --runtime-dir. The robot file is required unless the program says otherwise of the option.
CLI::Option* add_robot(CLI::App& app, RobotOptions& options, const std::string& what);
void add_runtime_directory(CLI::App& app, RobotOptions& options);
// --policy-user USER: `may`, as "may lend a policy, but not arm".
void add_policy_user(CLI::App& app, RobotOptions& options, const std::string& may);

std::string runtime_directory_of(const RobotOptions& options, const config::RobotConfig& robot);
// None: ours only. The error is one sentence (exit code 64).
std::expected<std::optional<uid_t>, std::string> policy_user_of(const RobotOptions& options);

// True once SIGTERM, SIGINT or SIGHUP came. They are caught from the first call on.
std::atomic<bool>& stop_on_signals();

// One line on stderr; returns the exit code.
int refuse(int exit_code, const std::string& sentence);

// Adds --version and reads the command line. The exit code, where the program ends here.
std::optional<int> parse(CLI::App& app, int argc, char** argv);
// Logs as `name`, runs, and turns what is thrown into kExitInternal.
int run(const std::string& name, const std::function<int()>& body);

}  // namespace takt::program
