// Which joints or buses a cause is about, in words: from the record of the tick in which it held and the robot file.
#pragma once

#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::drivers {

// "joint elbow: over-temperature"; several are joined by "; ". Empty: the cause is about the robot as a whole.
std::string cause_detail(Cause cause, const TickRecord& record, const config::RobotConfig& robot);

}  // namespace takt::drivers
