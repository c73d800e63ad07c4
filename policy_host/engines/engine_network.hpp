// A plugin's network behind the Network port.
//
// Outputs without names (TorchScript's) get theirs by their order: the first is the actions, each further one feeds the
// next of the inputs that are hidden state by their names. A recurrent network that was exported without its state is
// not noticed: plugins say nothing of what is inside. Equal inputs give equal bits on one machine with one version of
// the library, and no further. Errors: one line. Thread rule: load at set-up.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/network.hpp"

namespace takt::policy_host {

// `plugin`: a path. `file`: the network's; policy.engine of `robot` says how it is run.
std::expected<std::unique_ptr<Network>, std::string> load_engine_network(const std::string& plugin,
                                                                         const config::RobotConfig& robot,
                                                                         const std::filesystem::path& file);

}  // namespace takt::policy_host
