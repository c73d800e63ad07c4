// SPDX-License-Identifier: Apache-2.0
// takt rollback: back to the deployment before, by hand.
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/robot/deployed_robot.hpp"
#include "cli/robot/executive_guard.hpp"
#include "config/load.hpp"
#include "systemd/deploy/store.hpp"

namespace takt::cli {
namespace {

struct RollbackOptions : DeploymentOptions {
  std::string to;
};

std::expected<int, Refusal> roll_back(const RollbackOptions& options) {
  auto store = deploy::Store::open(options.store);
  if (!store) return std::unexpected(Refusal{kExitFailed, store.error()});
  const std::string from = store->current(), to = options.to.empty() ? store->previous() : options.to;
  if (to.empty())
    return std::unexpected(Refusal{
        kExitFailed, from.empty() ? fmt::format("nothing was deployed to {}; name its --store", options.store)
                                  : fmt::format("nothing was in use before {}; --to names any folder of {}/deployments",
                                                from, options.store)});
  const auto file = store->robot_file(to);
  if (!file) return std::unexpected(Refusal{kExitFailed, file.error()});
  if (const auto disarmed = require_disarmed({options.place.runtime_directory}); !disarmed)
    return std::unexpected(disarmed.error());
  const auto robot = config::load(*file);
  if (!robot) return std::unexpected(Refusal{kExitFailed, robot.error()});
  if (const auto as_tried = store->is_as_tried(to); !as_tried)  // the way back stays open
    fmt::print(stderr, "warning: {}\n", as_tried.error());
  catch_interruptions();
  if (const auto used = store->use(to); !used) return std::unexpected(Refusal{kExitFailed, used.error()});
  note_deployment(robot->record.directory, *robot,
                  {"rollback", from, to, {}, {}, {}, store->is_proven(to) ? "proven" : "never proven"});
  if (const auto restarted = restart_and_wait(options.place, wanted_hosts(*robot)); !restarted)
    return std::unexpected(Refusal{kExitFailed, fmt::format("{} is in use again: {}", to, restarted.error().sentence)});
  if (options.json)
    fmt::print("{}\n", json_line(nlohmann::ordered_json{{"from", from}, {"to", to}, {"proven", store->is_proven(to)}}));
  else
    fmt::print("{} is in use {} instead of {}{}\n", to,
               options.place.restart.empty() ? "from the next start on" : "again", from.empty() ? "nothing" : from,
               store->is_proven(to) ? "" : fmt::format("; {} never passed a probation", to));
  return kExitOk;
}

}  // namespace

void add_rollback(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("rollback", "Go back to the deployment that was in use before.");
  auto options = std::make_shared<RollbackOptions>();
  command->add_option("--to", options->to, "name of a deployment; default: the one before");
  add_deployment_options(*command, *options);
  command->footer(
      "Example: sudo takt rollback\n"
      "Without systemd and --restart it changes what is in use at the next start.\n"
      "Exit codes: 0 in use again, 1 refused (armed, nothing before), or in use and not running: the line says which, "
      "64 command line.");
  command->callback([options, &exit_code] {
    settle_restart(*options);
    const auto done = roll_back(*options);
    if (!done) fmt::print(stderr, "takt rollback: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
