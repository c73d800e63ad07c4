// SPDX-License-Identifier: Apache-2.0
// The sensor of a robot file through which a person commands: what `takt command` and `takt gamepad` share.
#pragma once

#include <expected>
#include <string>

#include "cli/command.hpp"
#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::cli {

std::expected<config::Sensor, Refusal> command_sensor(const config::RobotConfig& robot, const std::string& name);

// What a policy reads makes its command as old: what a person holds is said again long before it would count, and so
// often that one or two samples that come late change nothing.
Duration saying_interval(Duration timeout);

// From now on SIGTERM and Ctrl-C end what a person says, and no longer the process.
void release_on_signals();
bool is_released();

}  // namespace takt::cli
