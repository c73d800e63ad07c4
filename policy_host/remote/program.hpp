// SPDX-License-Identifier: Apache-2.0
// What both ends of a remote policy do before they begin: the robot file and the policy's identity.
#pragma once

#include <CLI/CLI.hpp>
#include <expected>
#include <string>

#include "config/load.hpp"
#include "executive/program/program.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::policy_host::remote {

struct CommonOptions : program::RobotOptions {
  std::string interface;
};

inline void add_common(CLI::App& app, CommonOptions& options) {
  program::add_robot(app, options, "robot file with `policy` and `dds`, the same on both machines");
  program::add_runtime_directory(app, options);
  app.add_option("--interface", options.interface, "this machine's network interface, where it is not dds.interface");
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
  const std::string directory = program::runtime_directory_of(options, *robot);
  return Prepared{std::move(*robot), *hash, directory};
}

}  // namespace takt::policy_host::remote
