// SPDX-License-Identifier: Apache-2.0
// What all that leads one joint softly, without a policy, looks after: `takt joint jog`, and the search for a stop.
// Pure.
#pragma once

#include <string>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::commissioning {

inline constexpr Duration kLedSilence = milliseconds(100);  // of a drive that is pushed: longer, and it is released
inline constexpr Duration kLedYoung = milliseconds(20);     // a reading that a push may stem from

// Why an enabled drive is to be let go at once; empty: it is enabled, heard and without a fault.
std::string drive_trouble(const config::Drive& drive, const JointFeedback& feedback, MonoTime now);

}  // namespace takt::commissioning
