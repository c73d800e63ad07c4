// The robot's configuration as the tick wants it: fixed-size, float32, no strings. `policy_hash` 0 accepts any policy.
#pragma once

#include <cstdint>

#include "config/robot_config.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::config {

pipeline::TickConfig tick_config_of(const RobotConfig& robot, std::uint64_t policy_hash);

}  // namespace takt::config
