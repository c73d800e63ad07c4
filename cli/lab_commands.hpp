// SPDX-License-Identifier: Apache-2.0
// The commands that program `takt-lab` carries: what evaluates policies and runs, and what no robot needs. `takt` hands
// them over, and its help lists them whether takt-lab is installed or not. No library but libstdc++ and libc.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string_view>

namespace takt::cli {

struct LabCommand {
  std::string_view parent;  // "policy", of `takt policy try`; empty: it stands by itself
  std::string_view name;    // unique
  std::string_view sentence;
};
std::span<const LabCommand> lab_commands();

// True where `words`, without the program and without `help` before them, begin with one.
bool is_of_the_lab(std::span<char* const> words);

// Adds one of them below `app`, and the parent where it is missing.
CLI::App* add_lab_command(CLI::App& app, std::string_view name);

}  // namespace takt::cli
