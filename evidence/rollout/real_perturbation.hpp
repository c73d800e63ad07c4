// SPDX-License-Identifier: Apache-2.0
// A panel's perturbation where processes are real: what `takt run` and its processes are told to do to the robot, by
// the column `real` of config/trouble/kinds.hpp. Those that have no mechanism there are refused by name, never silently
// left out.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"

namespace takt::evidence {

struct RealTrouble {
  std::vector<std::string> actions = {};        // of `takt run --at`, times since tracking began
  std::string plant_scenario = {};              // text of a scenario file, times since the drives were enabled
  std::vector<std::string> policy_faults = {};  // of `takt-policy-host --fault`, times since tracking began
};

// The joint whose drive says what is not so (feedback_frozen, ...); of the seed, among those that are driven.
std::size_t lying_joint(const config::RobotConfig& robot, std::uint64_t seed);
// Of the robot file's sensors those that its simulator plays: the camera's, and the IMU of a model of MuJoCo's.
std::vector<std::string> simulated_sensors(const config::RobotConfig& robot);
// The error: one sentence, why this perturbation, or this dose of it, cannot be given to this robot.
std::expected<RealTrouble, std::string> real_trouble_of(const Perturbation& perturbation,
                                                        const config::RobotConfig& robot, std::uint64_t seed);

}  // namespace takt::evidence
