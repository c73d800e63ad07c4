// SPDX-License-Identifier: Apache-2.0
// takt panel: rollouts of a panel and their artifacts.
#include "cli/command.hpp"
#include "cli/lab_commands.hpp"

namespace takt::cli {

void add_panel(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "panel");
  command->require_subcommand(1);
  add_panel_run(*command, exit_code);
  add_panel_merge(*command, exit_code);
  add_panel_attest(*command, exit_code);
}

}  // namespace takt::cli
