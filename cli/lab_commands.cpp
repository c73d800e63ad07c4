// SPDX-License-Identifier: Apache-2.0
#include "cli/lab_commands.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "cli/command.hpp"

namespace takt::cli {
namespace {

constexpr std::array kLabCommands{
    LabCommand{"", "panel", "Panels of rollouts and their artifacts."},
    LabCommand{"", "compare", "Compare two methods row by row, if they are comparable."},
    LabCommand{"", "margin", "Measure the stabiliser's margins and the command age that the task tolerates."},
    LabCommand{"", "ablate", "Switch off one protection after the other in rollouts, and show what each costs."},
    LabCommand{"", "budget", "Draw which loop rates fit, and how old the commands then are."},
    LabCommand{"", "ages", "Judge a list of command ages by the freshness contract."},
    LabCommand{"", "audit", "Say whether a panel's artifact or a run is ready to be audited."},
    LabCommand{"", "seal", "Sign an artifact, a run, or a panel before it runs, with a key of yours."},
    LabCommand{"", "export", "Write runs as data sets for training."},
    LabCommand{"policy", "try",
               "Try every policy of a folder: which engine takes it, error and time against ONNX Runtime."},
    LabCommand{"policy", "calibrate",
               "Thresholds for a policy's chunk monitors, from runs or a panel without a fault."},
    LabCommand{"trace", "review", "Say where the time went in a trace, and check it against a run."}};

CLI::App* child_of(CLI::App& parent, std::string_view name) {
  const auto children = parent.get_subcommands([name](const CLI::App* child) { return child->get_name() == name; });
  return children.empty() ? nullptr : children.front();
}

}  // namespace

std::span<const LabCommand> lab_commands() {
  return kLabCommands;
}

bool is_of_the_lab(std::span<char* const> words) {
  return std::ranges::any_of(kLabCommands, [words](const LabCommand& command) {
    if (command.parent.empty()) return !words.empty() && words[0] == command.name;
    return words.size() > 1 && words[0] == command.parent && words[1] == command.name;
  });
}

CLI::App* add_lab_command(CLI::App& app, std::string_view name) {
  const LabCommand& command = *std::ranges::find(kLabCommands, name, &LabCommand::name);
  CLI::App* parent = &app;
  if (!command.parent.empty()) {
    parent = child_of(app, command.parent);
    if (parent == nullptr) parent = app.add_subcommand(std::string(command.parent))->require_subcommand(1);
  }
  // Not the group of its parent.
  return parent->add_subcommand(std::string(command.name), std::string(command.sentence))->group(kNoGroup);
}

}  // namespace takt::cli
