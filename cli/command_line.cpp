// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/mistyped.hpp"
#include "config/printable.hpp"
#include "executive/contract/version.hpp"
#include "executive/program/command_line_error.hpp"

namespace takt::cli {
namespace {

constexpr const char* kUnlisted = "";  // CLI11 hides such a group

// Listed like a command; `takt help X` is read as `takt X --help`.
void add_help(CLI::App& app) {
  CLI::App* const command =
      app.add_subcommand("help", "Say what a command does and which options it has: takt help NAME.");
  command->group("Help")->footer(
      "Examples: takt help; takt help run; takt help config check\n"
      "Exit codes: 0 said, 64 there is no such command.");
}

// Returns what the list of commands says of the group at its end.
std::string add_group(CLI::App& app, const CommandGroup& group, int& exit_code) {
  for (const AddCommand add : group.commands) add(app, exit_code);
  const auto is_new = [](const CLI::App* command) { return command->get_group() == kNoGroup; };
  std::vector<std::string> names;
  for (CLI::App* const command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!is_new(command)) continue;
    command->group(group.by_name_alone ? kUnlisted : group.title);
    names.push_back(command->get_name());
  }
  return group.by_name_alone ? fmt::format("{}:\n  {}\n\n", group.title, fmt::join(names, ", ")) : std::string();
}

std::vector<std::string> without_help_verb(std::vector<std::string> words) {
  const bool is_about_help_itself = words.size() > 1 && words[1] == "--help";
  if (words.empty() || words.front() != "help" || is_about_help_itself) return words;
  words.erase(words.begin());
  words.emplace_back("--help");
  return words;
}

int parse(CLI::App& app, std::vector<std::string> words) {
  const bool asks_for_help = !words.empty() && words.front() == "help";
  words = without_help_verb(std::move(words));
  const auto wrong = mistyped(app, words);
  if (wrong && asks_for_help) return refuse(kExitUsage, "takt: " + *wrong);
  try {
    std::ranges::reverse(words);  // CLI11 takes them from the back
    app.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    if (wrong) return refuse(kExitUsage, "takt: " + *wrong);
    std::fputs(program::command_line_answer(app, error).c_str(), stderr);
    return kExitUsage;
  }
  return kExitOk;
}

// What a command printed may still lie in a buffer, and a disk may be full.
int after_printing(int exit_code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return exit_code;
  std::fprintf(stderr, "takt: its output could not be written; is the disk full?\n");
  return exit_code == kExitOk ? kExitFailed : exit_code;
}

}  // namespace

int refuse(int exit_code, const std::string& sentences) {
  std::fprintf(stderr, "%s\n", config::printable(sentences).c_str());
  return exit_code;
}

int fail(std::string_view command, const std::string& sentence) {
  return refuse(kExitFailed, fmt::format("{}: {}", command, sentence));
}

void note(std::string_view kind, const std::string& sentence) {
  (void)refuse(kExitOk, fmt::format("{}: {}", kind, sentence));
}

int run_command_line(std::span<const CommandGroup> groups, int argc, const char* const* argv) {
  CLI::App app("Runs learned policies on robots in real time, and keeps the evidence.", "takt");
  app.set_version_flag("--version", fmt::format("takt {}", version()));
  app.require_subcommand(1);
  int exit_code = kExitOk;
  std::string by_name;
  for (const CommandGroup& group : groups) by_name += add_group(app, group, exit_code);
  app.footer(
      by_name +
      "Exit codes: 0 done, 1 refused or failed, 2 not all is well (run, replay), 64 command line, 65 configuration, 69 "
      "not running, 70 bug, 71 set-up.");
  add_help(app);
  try {
    const int parsed = parse(app, std::vector<std::string>(argv + std::min(argc, 1), argv + argc));
    return after_printing(parsed == kExitOk ? exit_code : parsed);
  } catch (const std::filesystem::filesystem_error& error) {  // a path that was typed, or stands in a file
    return refuse(kExitFailed, fmt::format("takt: {}: {}; name another path, or correct this one",
                                           error.path1().string(), error.code().message()));
  } catch (const std::exception& error) {
    if (std::ferror(stdout) != 0) return after_printing(kExitOk);
    return refuse(kExitInternal, fmt::format("takt: {}", error.what()));
  }
}

}  // namespace takt::cli
