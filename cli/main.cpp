// SPDX-License-Identifier: Apache-2.0
// `takt`: stops a robot and tells of it by itself, and hands every other command to takt-operate or takt-lab, beside
// it.
#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "cli/command.hpp"
#include "cli/hand_over.hpp"
#include "cli/lab_commands.hpp"

namespace takt::cli {
namespace {

bool is_own(std::string_view word) {
  CLI::App app;
  int ignored = 0;
  for (const AddCommand add : operator_commands()) add(app, ignored);
  return std::ranges::any_of(app.get_subcommands([](const CLI::App*) { return true; }),
                             [word](const CLI::App* command) { return command->check_name(std::string(word)); });
}

// What `takt help` is asked about, or what it is to do.
std::span<char* const> asked(std::span<char* const> words) {
  return words.size() > 1 && std::string_view(words[0]) == "help" ? words.subspan(1) : words;
}

// takt stop ..., takt help stop ..., takt --version.
bool is_own(std::span<char* const> words) {
  if (words.size() == 1 && std::string_view(words[0]) == "--version") return true;
  return !words.empty() && is_own(asked(words)[0]);
}

}  // namespace
}  // namespace takt::cli

int main(int argc, char** argv) {
  using namespace takt::cli;
  const std::span<char* const> words(argv + (argc > 0 ? 1 : 0), argv + argc);
  if (is_own(words)) {
    const CommandGroup own{"Run a robot", operator_commands()};
    return run_command_line({&own, 1}, argc, argv);
  }
  return hand_over(is_of_the_lab(asked(words)) ? kLabProgram : kOperateProgram, argv);
}
