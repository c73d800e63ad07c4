// A tick as ROS 2's diagnostics: one part for the executive, one for each joint's drive, one for each bus.
#pragma once

#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/dds/messages.hpp"

namespace takt::monitor::dds {

// `status` as of the same tick.
std::vector<Diagnostic> diagnose(const TickRecord& record, const Status& status, const config::RobotConfig& robot);
// No executive answers: one part, stale.
std::vector<Diagnostic> diagnose_absence(const config::RobotConfig& robot);

}  // namespace takt::monitor::dds
