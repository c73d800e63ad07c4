// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string>

#include "cli/command.hpp"
#include "cli/lab_commands.hpp"

namespace takt::cli {
namespace {

// Listed only: another program carries them, and `takt` hands over to it.
void list_lab_commands(CLI::App& app, int& exit_code) {
  for (const LabCommand& command : lab_commands())
    add_lab_command(app, command.name)->callback([&exit_code] {
      exit_code = refuse(kExitUsage, "takt-operate does not carry this command: type `takt`, which finds who does");
    });
}

constexpr std::array kRun{add_run, add_arm, add_stop, add_reset, add_status, add_top, add_mark};
constexpr std::array kSetUp{add_config, add_bus, add_joint, add_policy, add_doctor, add_deploy, add_rollback};
constexpr std::array kLookBack{add_report, add_replay};
constexpr std::array kMore{add_person_command, add_gamepad, add_runs, add_trace};
constexpr std::array kEvaluate{list_lab_commands};
constexpr std::array kGroups{CommandGroup{"Run a robot", kRun}, CommandGroup{"Set one up", kSetUp},
                             CommandGroup{"Look at runs", kLookBack}, CommandGroup{"More", kMore, true},
                             CommandGroup{"Evaluate, by package takt-lab", kEvaluate, true}};

}  // namespace

std::span<const CommandGroup> commands() {
  return kGroups;
}

}  // namespace takt::cli
