// A plugin's network behind the Policy port: which of its tensors is what (policy_tensors.hpp), hidden state that goes
// round, the time step.
//
// Outputs without names (TorchScript's) go by their order: the first is the actions, each further one feeds the next of
// the inputs that are hidden state by their names. A recurrent network that was exported without its state is not
// noticed: plugins say nothing of what is inside. Equal inputs give equal bits on one machine with one version of the
// library, and no further. Errors: one line. Thread rule: load at set-up.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/engines/plugin.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

// `plugin`: a path. Infers once, so that the first answer is no slower than others.
std::expected<std::unique_ptr<Policy>, std::string> load_engine_policy(const std::string& plugin,
                                                                       const config::RobotConfig& robot);

}  // namespace takt::policy_host
