// SPDX-License-Identifier: Apache-2.0
#include "cli/lab/panel_choice.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "cli/run/policy_host_option.hpp"
#include "cli/world_option.hpp"
#include "config/load.hpp"
#include "lab/panel/sequential_decision.hpp"

namespace takt::cli {
namespace {

// One robot has one task: of a panel of several, --robot runs its own alone. Empty: fine.
std::string keep_task_of(const std::string& robot_file, lab::Panel& panel) {
  if (robot_file.empty() || panel.tasks.size() < 2) return {};
  const auto robot = config::load(robot_file);
  if (!robot) return robot.error();
  const evidence::Task task = evidence::task_of(*robot);
  std::erase_if(panel.tasks, [&](const lab::PanelTask& one) { return one.task != task; });
  if (!panel.tasks.empty()) return {};
  return fmt::format("{}: the panel has no task {}, which this robot is for; name another robot by --robot", panel.file,
                     evidence::kTaskNames[static_cast<std::size_t>(task)]);
}

}  // namespace

std::expected<ChosenPanel, Refusal> chosen_panel(const char* command, const std::string& file,
                                                 const PanelChoice& choice) {
  auto panel = lab::load_panel(file);
  if (!panel) return std::unexpected(Refusal{config::kExitBadConfiguration, panel.error()});
  ChosenPanel chosen{std::move(*panel), {}};
  if (!choice.method.empty()) {
    std::vector<std::string> names;
    for (const auto& one : chosen.panel.methods) names.push_back(one.name);
    std::erase_if(chosen.panel.methods, [&](const auto& one) { return one.name != choice.method; });
    if (chosen.panel.methods.empty())
      return std::unexpected(Refusal{kExitUsage, fmt::format("{}: --method {}: no method of this panel; it has {}",
                                                             command, choice.method, fmt::join(names, ", "))});
  }
  if (!choice.until_decided.empty()) {
    auto two = lab::keep_two_methods(choice.until_decided, chosen.panel);
    if (!two)
      return std::unexpected(
          Refusal{kExitUsage, fmt::format("{}: --until-decided {}: {}", command, choice.until_decided, two.error())});
    chosen.rivals = std::move(*two);
  }
  if (choice.seeds != 0) chosen.panel.seed_count = choice.seeds;
  chosen.panel.robot = choice.robot;
  if (const std::string why = keep_task_of(choice.robot, chosen.panel); !why.empty())
    return std::unexpected(Refusal{config::kExitBadConfiguration, why});
  return chosen;
}

void add_panel_choice(CLI::App& command, PanelChoice& choice) {
  command.add_option("--robot", choice.robot,
                     "robot file instead of those that the panel names; of several tasks, only its own runs");
  auto* const method = command.add_option("--method", choice.method, "run this one of the panel's methods");
  command.add_option("--seeds", choice.seeds, "this many seeds from the first on, instead of the panel's count")
      ->check(CLI::Range(1, 1'000'000));
  command
      .add_option("--until-decided", choice.until_decided,
                  "A,B: run only these two methods, seed by seed, until it is decided which succeeds more often")
      ->excludes(method);
  add_world(command, choice.world);
  add_policy_host(command, choice.policy_host);
  add_policy_may(command, choice.policy_may);
}

}  // namespace takt::cli
