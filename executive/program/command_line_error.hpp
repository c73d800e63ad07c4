// SPDX-License-Identifier: Apache-2.0
// What a program answers to a command line that it does not understand. Any thread.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace takt::program {

// One line: "takt-plant: --robot is required; `takt-plant --help` lists what it takes". A group that got no command
// answers with its help. Words that were typed are printable in it. Source: what CLI11 says in `error`.
std::string command_line_answer(const CLI::App& app, const CLI::ParseError& error);

}  // namespace takt::program
