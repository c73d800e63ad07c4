// SPDX-License-Identifier: Apache-2.0
#include "cli/command.hpp"

int main(int argc, char** argv) {
  return takt::cli::run_command_line(takt::cli::commands(), argc, argv);
}
