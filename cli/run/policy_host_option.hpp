// SPDX-License-Identifier: Apache-2.0
// `--policy-host` of the commands that roll robots out: the program that is the policy. `--policy-may` of all that
// start one: what it is allowed beyond its boundary (policy_host/boundary.hpp).
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

#include "policy_host/boundary.hpp"

namespace takt::cli {

inline CLI::Option* add_policy_host(CLI::App& command, std::string& program) {
  return command.add_option("--policy-host", program,
                            "program to start instead of takt-policy-host: a policy in Python or C "
                            "(docs/python-policy.md);\nwith its options, quoted");
}

// What is none of the three is a usage error.
inline CLI::Option* add_policy_may(CLI::App& command, policy_host::Grants& grants) {
  return command
      .add_option_function<std::vector<std::string>>(
          "--policy-may",
          [&grants](const std::vector<std::string>& texts) {
            auto parsed = policy_host::parse_grants(texts);
            if (!parsed) throw CLI::ValidationError("--policy-may", parsed.error());
            grants = std::move(*parsed);
          },
          "allow the policy more: network, write=FOLDER or everything (docs/policies.md)")
      ->allow_extra_args(false);
}

}  // namespace takt::cli
