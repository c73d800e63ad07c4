#include <array>
#include <cstdio>
#include <exception>

#include "cli/command.hpp"
#include "takt_version.hpp"

namespace takt::cli {
namespace {

constexpr std::array kCommands{add_run,     add_arm,    add_stop,   add_reset,  add_mark,   add_status, add_top,
                               add_report,  add_replay, add_trace,  add_config, add_bus,    add_joint,  add_audit,
                               add_compare, add_panel,  add_budget, add_margin, add_doctor, add_deploy, add_rollback};

}  // namespace

std::span<const AddCommand> commands() {
  return kCommands;
}

int run_command_line(int argc, const char* const* argv) {
  CLI::App app("Runs learned policies on robots in real time, and keeps the evidence.", "takt");
  app.set_version_flag("--version", "takt " TAKT_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 done, 1 refused or failed, 64 command line, 65 configuration, 69 not running, 70 bug, 71 set-up.");
  int exit_code = kExitOk;
  for (const AddCommand add : commands()) add(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "takt: %s\n", error.what());
    return kExitInternal;
  }
  return exit_code;
}

}  // namespace takt::cli
