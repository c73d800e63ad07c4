// SPDX-License-Identifier: Apache-2.0
// `--policy-host` of the commands that roll robots out: the program that is the policy.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace takt::cli {

inline CLI::Option* add_policy_host(CLI::App& command, std::string& program) {
  return command.add_option("--policy-host", program,
                            "program to start instead of takt-policy-host: a policy in Python or C "
                            "(docs/python-policy.md);\nwith its options, quoted");
}

}  // namespace takt::cli
