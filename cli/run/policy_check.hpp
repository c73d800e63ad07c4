// SPDX-License-Identifier: Apache-2.0
// What takt-policy-host would refuse of a robot file at its start: said before anything is started.
#pragma once

#include <string>

#include "config/robot_config.hpp"

namespace takt::cli {

// One line; empty: nothing. Of the policy, and of the fallback policy. A file that is no network is another host's.
// Loading keeps the process off the executive's processor for good (policy_host/fenced_load.hpp): call it where nothing
// else is to be done, or in_own_process.
std::string refused_by_policy_host(const config::RobotConfig& robot);

}  // namespace takt::cli
