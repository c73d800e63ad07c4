// SPDX-License-Identifier: Apache-2.0
// `takt`: stops a robot and tells of it by itself, and hands every other command to takt-operate, beside it.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "cli/command.hpp"

namespace takt::cli {
namespace {

bool is_own(std::string_view word) {
  CLI::App app;
  int ignored = 0;
  for (const AddCommand add : operator_commands()) add(app, ignored);
  return std::ranges::any_of(app.get_subcommands([](const CLI::App*) { return true; }),
                             [word](const CLI::App* command) { return command->get_name() == word; });
}

// takt stop ..., takt help stop ..., takt --version.
bool is_own(std::span<char* const> words) {
  if (words.size() > 1 && std::string_view(words[0]) == "help") return is_own(words[1]);
  if (words.size() == 1 && std::string_view(words[0]) == "--version") return true;
  return !words.empty() && is_own(words[0]);
}

int hand_over(char** argv) {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "takt-operate";
  execv(program.c_str(), argv);
  std::fprintf(stderr, "takt: %s cannot be started: %s; it comes with takt: install that again\n", program.c_str(),
               std::strerror(errno));
  return kExitUnavailable;
}

}  // namespace
}  // namespace takt::cli

int main(int argc, char** argv) {
  using namespace takt::cli;
  const std::span<char* const> words(argv + (argc > 0 ? 1 : 0), argv + argc);
  return is_own(words) ? run_command_line(operator_commands(), argc, argv) : hand_over(argv);
}
