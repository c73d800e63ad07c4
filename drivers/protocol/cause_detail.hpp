// SPDX-License-Identifier: Apache-2.0
// Which joints or buses a cause is about, in words: from the record of the tick in which it held and the robot file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::drivers {

enum class CausePlace : std::uint8_t { joint, bus };
struct CauseFinding {
  CausePlace place = CausePlace::joint;
  std::size_t index = 0;  // into the robot file's joints or buses
  std::string what;       // "over-temperature"
};
using CauseFindings = std::vector<CauseFinding>;
// Nothing: the cause is about the robot as a whole.
CauseFindings cause_findings(Cause cause, const TickRecord& record, const config::RobotConfig& robot);
// "joint elbow"
std::string place_text(const CauseFinding& finding, const config::RobotConfig& robot);

// "joint elbow: over-temperature"; several are joined by "; ". Empty: the cause is about the robot as a whole.
std::string cause_detail(Cause cause, const TickRecord& record, const config::RobotConfig& robot);

}  // namespace takt::drivers
