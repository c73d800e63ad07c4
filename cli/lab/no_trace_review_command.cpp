// SPDX-License-Identifier: Apache-2.0
// takt trace review, where the build leaves it out (TAKT_WITH_TRACE_REVIEW).
#include "cli/command.hpp"
#include "cli/lab_commands.hpp"

namespace takt::cli {

void add_trace_review(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "review");
  command->allow_extras()->footer("Example: takt trace review DIR\nExit codes: 69 this build has none.");
  command->callback([&exit_code] {
    exit_code = refuse(kExitUnavailable, "takt trace review: this takt-lab was built without TAKT_WITH_TRACE_REVIEW");
  });
}

}  // namespace takt::cli
