// SPDX-License-Identifier: Apache-2.0
// The subcommands of `takt`: one file each, listed in one table of the program that carries them
// (operator_commands.cpp: takt; commands.cpp: takt-operate; lab/main.cpp: takt-lab).
//
// An AddCommand adds its subcommand to the application; when the user picked it, the subcommand's callback runs the
// command and stores the exit code. To add a command: write its file, declare it here, add one line to the table.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/exit_codes.hpp"

namespace takt::cli {

// Beside those of every program.
inline constexpr int kExitOk = 0;
inline constexpr int kExitNotJudged = 2;   // replay: what was judged reproduces, but not all could be judged
inline constexpr int kExitStopped = 2;     // a stop or fault that was not asked for stands
inline constexpr int kExitWrongScale = 3;  // joint jog: it moved as asked, and a scale is wrong
inline constexpr int kExitNotSeen = 4;     // joint jog: it moved as asked, and an eye alone can judge its scale

// Why a command ends before its work, and with which code.
struct Refusal {
  int exit_code = kExitFailed;
  std::string sentence;
};

// How a command says on stderr why it ends, and what it noticed. Sentences may hold what others wrote: what a terminal
// would obey is shown instead (config/printable.hpp).
int refuse(int exit_code, const std::string& sentences);          // returns exit_code
int fail(std::string_view command, const std::string& sentence);  // "takt report: ...": kExitFailed
void note(std::string_view kind, const std::string& sentence);    // "note: ..."

using AddCommand = void (*)(CLI::App& app, int& exit_code);

inline constexpr const char* kNoGroup = "Subcommands";  // CLI11's title of commands that have no other

// Commands that `takt help` lists under one title.
struct CommandGroup {
  const char* title;
  std::span<const AddCommand> commands;
  bool by_name_alone = false;  // in one line, behind the others
};

void add_run(CLI::App& app, int& exit_code);
void add_runs(CLI::App& app, int& exit_code);
void add_arm(CLI::App& app, int& exit_code);
void add_stop(CLI::App& app, int& exit_code);
void add_reset(CLI::App& app, int& exit_code);
void add_mark(CLI::App& app, int& exit_code);
void add_person_command(CLI::App& app, int& exit_code);
void add_gamepad(CLI::App& app, int& exit_code);
void add_status(CLI::App& app, int& exit_code);
void add_top(CLI::App& app, int& exit_code);
void add_report(CLI::App& app, int& exit_code);
void add_replay(CLI::App& app, int& exit_code);
void add_panel(CLI::App& app, int& exit_code);
void add_trace(CLI::App& app, int& exit_code);
void add_trace_review(CLI::App& app, int& exit_code);
void add_config(CLI::App& app, int& exit_code);
void add_bus(CLI::App& app, int& exit_code);
void add_bus_scan(CLI::App& bus, int& exit_code);      // below add_bus's
void add_bus_zero(CLI::App& bus, int& exit_code);      // below add_bus's
void add_joint_home(CLI::App& joint, int& exit_code);  // below add_joint's
void add_bus_up(CLI::App& bus, int& exit_code);        // below add_bus's
void add_bus_disable(CLI::App& bus, int& exit_code);   // below add_bus's
void add_joint(CLI::App& app, int& exit_code);
void add_audit(CLI::App& app, int& exit_code);
void add_seal(CLI::App& app, int& exit_code);
void add_compare(CLI::App& app, int& exit_code);
void add_budget(CLI::App& app, int& exit_code);
void add_margin(CLI::App& app, int& exit_code);
void add_ablate(CLI::App& app, int& exit_code);
void add_ages(CLI::App& app, int& exit_code);
void add_export(CLI::App& app, int& exit_code);
void add_policy(CLI::App& app, int& exit_code);
void add_policy_check(CLI::App& policy, int& exit_code);  // below add_policy's
void add_policy_try(CLI::App& app, int& exit_code);
void add_policy_replay(CLI::App& policy, int& exit_code);  // below add_policy's
void add_policy_calibrate(CLI::App& app, int& exit_code);
void add_policy_shadow(CLI::App& policy, int& exit_code);  // below add_policy's, as are the next two
void add_policy_swap(CLI::App& policy, int& exit_code);
void add_policy_back(CLI::App& policy, int& exit_code);
void add_doctor(CLI::App& app, int& exit_code);
void add_deploy(CLI::App& app, int& exit_code);
void add_rollback(CLI::App& app, int& exit_code);
void add_panel_run(CLI::App& panel, int& exit_code);       // below add_panel's
void add_panel_merge(CLI::App& panel, int& exit_code);     // below add_panel's
void add_panel_attest(CLI::App& panel, int& exit_code);    // below add_panel's
void add_config_import(CLI::App& config, int& exit_code);  // below add_config's
void add_config_new(CLI::App& config, int& exit_code);

// Those that stop a robot or tell of it, which program `takt` carries itself: it links no library but libstdc++ and
// libc, so that half an upgrade leaves them working.
std::span<const AddCommand> operator_commands();
// Those included, all that run a robot, set one up and look at its runs: program `takt-operate`.
std::span<const CommandGroup> commands();

// Parses, runs, returns the exit code.
int run_command_line(std::span<const CommandGroup> groups, int argc, const char* const* argv);

}  // namespace takt::cli
