// SPDX-License-Identifier: Apache-2.0
// The time-out inside a drive: commands cease, and the drive stops by itself. What we write where it can be written,
// and what we accept where it cannot. Pure.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "config/robot_config.hpp"

namespace takt::drivers {

inline constexpr Duration kShortestDriveTimeout = milliseconds(50), kLongestDriveTimeout = seconds(1);
// Damiao's register 9 and RobStride's parameters 7028 and 200C count alike.
inline constexpr Duration kTimeoutUnit = microseconds(50);
// Ticks without a word after which a drive may have been without power, and with it without what it was told.
inline constexpr std::uint32_t kTicksToDoubt = 50;

// As long as we wait for the drive, it waits for us; within the bounds above.
inline Duration drive_timeout(const config::RobotConfig& robot) {
  return std::clamp(robot.feedback.timeout, kShortestDriveTimeout, kLongestDriveTimeout);
}

constexpr std::uint32_t timeout_units(Duration timeout) {
  return static_cast<std::uint32_t>(timeout.ns / kTimeoutUnit.ns);
}

// Whether a drive that tells this much of its time-out, in units, is stopped by it soon enough.
constexpr bool is_watchdog(std::optional<std::uint32_t> units) {
  return units && *units > 0 && *units <= timeout_units(kLongestDriveTimeout);
}

}  // namespace takt::drivers
