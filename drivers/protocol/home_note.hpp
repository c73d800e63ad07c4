// SPDX-License-Identifier: Apache-2.0
// A person's word on where a joint is, of a drive that forgets it and cannot be told (position_after_power_up): kept
// in the runtime directory for the next start of the executive, which takes it away. Nothing tells whether such a drive
// was switched off in between: so a note holds once, for kHomeNoteLasts, until this computer restarts, for the robot
// file that it was written with, and only while the joint stands about where it stood (JointDriver::assume_home).
// Set-up only.
#pragma once

#include <expected>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

struct HomeNote {
  double shift = 0;    // rad, of a slide m: to be added to what the drive reads (to drive.offset)
  double left_at = 0;  // rad, of a slide m: where the joint is, by the person's word
};

inline constexpr Duration kHomeNoteLasts = seconds(600);
// Since the person's word: 0.05 rad, of a slide of its motor.
inline float may_have_moved(const config::Joint& joint) {
  return 0.05F * static_cast<float>(config::per_rad(joint));
}

// The error is a sentence.
std::expected<void, std::string> write_home_note(const std::string& runtime_directory, const config::RobotConfig& robot,
                                                 std::size_t joint, const HomeNote& note);
// Those that hold, one entry per joint.
std::vector<std::optional<HomeNote>> home_notes(const std::string& runtime_directory, const config::RobotConfig& robot);
// The same; all notes are gone afterwards, whether they still held or not.
std::vector<std::optional<HomeNote>> take_home_notes(const std::string& runtime_directory,
                                                     const config::RobotConfig& robot);
// The robot by those notes: each one's shift is in its drive's offset.
config::RobotConfig homed_robot(const config::RobotConfig& robot, std::span<const std::optional<HomeNote>> notes);

}  // namespace takt::drivers
