// SPDX-License-Identifier: Apache-2.0
// `--world` of the commands that roll robots out in virtual time: the process that plays their mechanics.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <string>

namespace takt::cli {

inline CLI::Option* add_world(CLI::App& command, std::string& world) {
  return command.add_option(
      "--world", world,
      "socket of the process that plays the mechanics, or a command that starts one, with {} where\n"
      "the socket goes (docs/world-protocol.md)");
}

// Why so many workers cannot share that world; empty: they can.
inline std::string crowded_world(const std::string& world, std::size_t workers) {
  if (world.empty() || workers <= 1 || world.find("{}") != std::string::npos) return {};
  return "--world " + world + " plays one simulation at a time, so --workers is 1; a command with {} starts one each";
}

}  // namespace takt::cli
