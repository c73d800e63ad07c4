// SPDX-License-Identifier: Apache-2.0
#include "executive/program/command_line_error.hpp"

#include <cctype>

#include "config/printable.hpp"

namespace takt::program {

std::string command_line_answer(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App* asked = &app;
  std::string path = app.get_name();
  while (!asked->get_subcommands().empty()) {
    asked = asked->get_subcommands().front();
    path += ' ' + asked->get_name();
  }
  const bool is_group_alone = asked->get_require_subcommand_min() > 0 &&
                              error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError);
  if (is_group_alone) return app.help();  // of `asked`
  std::string said = error.what();
  if (said.size() > 1 && std::islower(static_cast<unsigned char>(said[1])) != 0)
    said[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(said[0])));
  return config::printable(path + ": " + said + "; `" + path + " --help` lists what it takes") + '\n';
}

}  // namespace takt::program
