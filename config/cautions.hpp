// What a valid robot file costs or takes on trust: told by `takt config check`, refused by nobody. Pure.
#pragma once

#include <string>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::config {

// Sentences of one line, none where there is nothing to say.
std::vector<std::string> cautions_about(const RobotConfig& robot);

}  // namespace takt::config
