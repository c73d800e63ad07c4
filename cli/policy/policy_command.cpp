// SPDX-License-Identifier: Apache-2.0
// takt policy: what a policy file is, before anything moves, and what it said in a run.
#include "cli/command.hpp"

namespace takt::cli {

void add_policy(CLI::App& app, int& exit_code) {
  CLI::App* parent =
      app.add_subcommand("policy", "Say what a policy file is, replay what it said, change it on a live robot.");
  parent->require_subcommand(1);
  add_policy_check(*parent, exit_code);
  add_policy_replay(*parent, exit_code);
  add_policy_shadow(*parent, exit_code);
  add_policy_swap(*parent, exit_code);
  add_policy_back(*parent, exit_code);
}

}  // namespace takt::cli
