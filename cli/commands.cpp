// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "cli/command.hpp"

namespace takt::cli {
namespace {

constexpr std::array kCommands{
    add_run,     add_runs,    add_arm,    add_stop,   add_reset,  add_mark, add_person_command, add_gamepad, add_status,
    add_top,     add_report,  add_replay, add_trace,  add_config, add_bus,  add_joint,          add_audit,   add_seal,
    add_compare, add_panel,   add_budget, add_margin, add_ablate, add_ages, add_export,         add_policy,  add_doctor,
    add_deploy,  add_rollback};

}  // namespace

std::span<const AddCommand> commands() {
  return kCommands;
}

}  // namespace takt::cli
