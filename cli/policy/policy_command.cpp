// takt policy: what a policy file is, before anything moves.
#include "cli/command.hpp"

namespace takt::cli {

void add_policy(CLI::App& app, int& exit_code) {
  CLI::App* parent =
      app.add_subcommand("policy", "Say what a policy file is and whether it runs, before anything moves.");
  parent->require_subcommand(1);
  add_policy_check(*parent, exit_code);
  add_policy_try(*parent, exit_code);
}

}  // namespace takt::cli
