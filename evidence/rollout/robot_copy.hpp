// SPDX-License-Identifier: Apache-2.0
// A robot as a rollout has it, with its overrides, as a file of its own for other processes: the same SHA-256. Policies
// that the file names relative to itself are linked beside it, with what belongs to them.
#pragma once

#include <expected>
#include <string>

#include "config/robot_config.hpp"

namespace takt::evidence {

// Writes FOLDER/robot.yaml. The error is one sentence.
std::expected<void, std::string> write_robot(const config::RobotConfig& robot, const std::string& folder);

}  // namespace takt::evidence
