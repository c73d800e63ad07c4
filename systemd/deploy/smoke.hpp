// SPDX-License-Identifier: Apache-2.0
// Does a robot file with its policy work at all, before it touches a robot? The network is loaded and must fit,
// or the program takes the robot; where
// the file has `simulation`, one rollout of a few seconds in virtual time: it must come to tracking and stay there,
// without a stop, a fault or a measured value outside the envelope. Says nothing about how well the task is done.
// The process is kept off the executive's processor for good, and what it starts (policy_host/fenced_load.hpp).
#pragma once

#include <expected>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/rollout/outside_processes.hpp"

namespace takt::deploy {

inline constexpr Duration kSmokeLength = seconds(5);

// What was tried, in one sentence; the error: what failed, one problem per line.
std::expected<std::string, std::string> smoke_run(const config::RobotConfig& robot,
                                                  const evidence::OutsideProcesses& outside = {});

}  // namespace takt::deploy
