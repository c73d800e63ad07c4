// SPDX-License-Identifier: Apache-2.0
// Whether this version takes a robot file, for a package that is not unpacked yet (cmake/package/preinst): check-robot
// FILE. Exit codes: 0 it does; 64 command line; 65 it does not, and why.
#include <fmt/format.h>

#include <span>

#include "cli/run/checked_robot.hpp"
#include "config/load.hpp"
#include "executive/contract/exit_codes.hpp"

int main(int argc, char** argv) {
  const std::span arguments(argv, static_cast<std::size_t>(argc));
  if (arguments.size() != 2) {
    fmt::print(stderr, "check-robot: name one robot file\n");
    return takt::kExitUsage;
  }
  const auto checked = takt::cli::check_robot_file(arguments[1]);
  if (checked) return 0;
  fmt::print(stderr, "{}\n", takt::cli::first_problems(checked.error()));
  return takt::config::kExitBadConfiguration;
}
