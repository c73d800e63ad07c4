// SPDX-License-Identifier: Apache-2.0
// `takt-lab`: the commands of `takt` that evaluate.
#include <array>

#include "cli/command.hpp"

namespace takt::cli {
namespace {

constexpr std::array kCommands{
    add_panel, add_compare, add_margin, add_ablate,     add_budget,           add_ages,
    add_audit, add_seal,    add_export, add_policy_try, add_policy_calibrate, add_trace_review};

}  // namespace
}  // namespace takt::cli

int main(int argc, char** argv) {
  const takt::cli::CommandGroup evaluate{"Evaluate", takt::cli::kCommands};
  return takt::cli::run_command_line({&evaluate, 1}, argc, argv);
}
