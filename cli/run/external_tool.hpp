// SPDX-License-Identifier: Apache-2.0
// Runs a third-party program to its end and keeps what it said. No shell in between: arguments need no quoting.
#pragma once

#include <string>
#include <vector>

namespace takt::cli {

struct ToolResult {
  int exit_code = 0;   // 128 + signal number when it was killed
  std::string output;  // of stdout and stderr together
};

inline constexpr int kToolMissing = 127;  // exit code when the program is not installed

// arguments[0] is looked up in PATH. Blocks until the program ended and closed its output.
ToolResult run_tool(std::vector<std::string> arguments);

// What comes by a pipe until its writers closed it, or it cannot be read.
std::string read_all(int descriptor);

}  // namespace takt::cli
