// SPDX-License-Identifier: Apache-2.0
// A plugin's network behind the Network port.
//
// Outputs without names (TorchScript's) get theirs by their order: the first is the actions, each further one feeds the
// next of the inputs that are hidden state by their names. Plugins say nothing of what is inside: what is known of it
// besides comes from the caller. Equal inputs give equal bits on one machine with one version of the library, and no
// further. Errors: one line. Thread rule: load at set-up.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "policy_host/network.hpp"

namespace takt::policy_host {

// What another reader found in a plugin's file.
struct FileReading {
  std::vector<std::string>
      lost_states;   // Network::lost_states; a plugin that keeps state itself (keeps_state) has none
  std::string note;  // for the description; "": nothing to say
};

// `plugin`: a path. `file`: the network's; policy.engine of `robot` says how it is run.
std::expected<std::unique_ptr<Network>, std::string> load_engine_network(const std::string& plugin,
                                                                         const config::RobotConfig& robot,
                                                                         const std::filesystem::path& file,
                                                                         FileReading reading);

}  // namespace takt::policy_host
