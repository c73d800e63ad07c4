// SPDX-License-Identifier: Apache-2.0
// Which part of a panel file runs, and with what: the same words for what runs it and for what registers it.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <expected>
#include <string>

#include "cli/command.hpp"
#include "lab/panel/panel_plan.hpp"
#include "policy_host/boundary.hpp"

namespace takt::cli {

struct PanelChoice {
  std::string robot, method, until_decided, world, policy_host;
  policy_host::Grants policy_may;
  std::uint64_t seeds = 0;  // 0: as many as the panel says
  [[nodiscard]] evidence::OutsideProcesses outside() const { return {world, policy_host, policy_may}; }
};
void add_panel_choice(CLI::App& command, PanelChoice& choice);

struct ChosenPanel {
  lab::Panel panel;
  std::array<std::string, 2> rivals;  // of --until-decided; empty: without
};
// `command`: for the sentence.
std::expected<ChosenPanel, Refusal> chosen_panel(const char* command, const std::string& file,
                                                 const PanelChoice& choice);

}  // namespace takt::cli
