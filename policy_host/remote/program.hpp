// SPDX-License-Identifier: Apache-2.0
// What both ends of a remote policy do before they begin: the robot file, the policy's identity, signals, refusals.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <expected>
#include <string>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/version.hpp"
#include "executive/log/program_log.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::policy_host::remote {

inline constexpr int kExitUsage = 64, kExitUnavailable = 69, kExitInternal = 70;

struct CommonOptions {
  std::string robot, runtime_directory, interface;
};

inline void add_common(CLI::App& app, CommonOptions& options) {
  app.add_option("--robot", options.robot, "robot file with `policy` and `dds`, the same on both machines")->required();
  app.add_option("--runtime-dir", options.runtime_directory,
                 "where the robot's sockets are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  app.add_option("--interface", options.interface, "this machine's network interface, where it is not dds.interface");
  app.set_version_flag("--version", std::string(takt::version()));
}

struct Prepared {
  config::RobotConfig robot;
  std::uint64_t policy_hash;
  std::string runtime_directory;
};

// The error is the robot file's (exit code 65).
inline std::expected<Prepared, std::string> prepare(const CommonOptions& options) {
  auto robot = config::load(options.robot);
  if (!robot) return std::unexpected(robot.error());
  if (const auto fine = check_policy_section(*robot); !fine) return std::unexpected(fine.error());
  if (!robot->dds)
    return std::unexpected(robot->file +
                           ": has no `dds`: the policy's machine is reached in its domain; add it "
                           "(docs/remote-policy.md)");
  if (!options.interface.empty()) robot->dds->interface = options.interface;
  const auto hash = config::policy_hash(robot->policy->file);
  if (!hash) return std::unexpected(hash.error());
  const std::string directory =
      options.runtime_directory.empty() ? config::default_runtime_directory(robot->robot) : options.runtime_directory;
  return Prepared{std::move(*robot), *hash, directory};
}

inline std::atomic<bool> g_stop = false;
static_assert(std::atomic<bool>::is_always_lock_free);

inline int refuse(const char* program, int exit_code, const std::string& sentence) {
  std::fprintf(stderr, "%s: %s\n", program, sentence.c_str());
  return exit_code;
}

// Parses, runs, and turns what is thrown into exit code 70.
template <class Run>
int run_program(const char* program, CLI::App& app, int argc, char** argv, Run run) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitUsage;
  }
  struct sigaction action {};
  action.sa_handler = [](int) { g_stop = true; };
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaction(number, &action, nullptr);
  try {
    log::log_to_stderr(program);
    return run();
  } catch (const std::exception& error) {
    return refuse(program, kExitInternal, std::string("internal error: ") + error.what());
  }
}

}  // namespace takt::policy_host::remote
