// SPDX-License-Identifier: Apache-2.0
// A person's word on where a joint is, of a drive that cannot be told (position_after_power_up: one_of_several): kept
// in the runtime directory for the next start of the executive, which takes it away. Nothing tells whether such a drive
// was switched off in between: so a note holds once, for kHomeNoteLasts, until this computer restarts, for the robot
// file that it was written with, and only while the joint stands about where it stood (JointDriver::assume_home).
// Set-up only.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

struct HomeNote {
  double shift = 0;    // rad: whole steps, to be added to what the drive reads (to drive.offset)
  double left_at = 0;  // rad: where the joint is, by the person's word
};

inline constexpr Duration kHomeNoteLasts = seconds(600);

// The error is a sentence.
std::expected<void, std::string> write_home_note(const std::string& runtime_directory, const config::RobotConfig& robot,
                                                 std::size_t joint, const HomeNote& note);
// One entry per joint; those notes are gone afterwards, whether they still held or not.
std::vector<std::optional<HomeNote>> take_home_notes(const std::string& runtime_directory,
                                                     const config::RobotConfig& robot);

}  // namespace takt::drivers
