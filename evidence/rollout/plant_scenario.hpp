// SPDX-License-Identifier: Apache-2.0
// Perturbations as scenarios of the simulator (docs/plant-scenarios.md): the text of a scenario file each, times since
// the drives were enabled. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"

namespace takt::evidence {

// can_loss, can_delay, bus_off.
std::string bus_scenario(const Perturbation& perturbation, const config::RobotConfig& robot);
// The joint whose drive says what is not so (feedback_frozen, ...); of the seed, among those that are driven.
std::size_t lying_joint(const config::RobotConfig& robot, std::uint64_t seed);
// feedback_frozen, feedback_repeated, feedback_reversed, feedback_jump, feedback_scale.
std::string feedback_scenario(const Perturbation& perturbation, const config::RobotConfig& robot, std::uint64_t seed);
// Of the robot file's sensors those that its simulator plays: the camera's, and the IMU of a model of MuJoCo's.
std::vector<std::string> simulated_sensors(const config::RobotConfig& robot);
// sensor_dropout, sensor_burst, camera_freeze, sensor_lies: of each of those.
std::string sensor_scenario(const Perturbation& perturbation, const config::RobotConfig& robot);
// push, payload, friction.
std::string body_scenario(const Perturbation& perturbation, std::uint64_t seed);

}  // namespace takt::evidence
