// SPDX-License-Identifier: Apache-2.0
// Where a joint is since power-on, of drives that forget it: which do, how they are told, and what is kept for those
// that cannot be told. Places: joint side, rad; of a slide m. Pure.
#pragma once

#include <expected>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/bus/can_frame.hpp"

namespace takt::commissioning {

// True of every moteus, and of drives whose entry says so (position_after_power_up).
bool forgets_home(const config::Drive& drive);

// Tells the drive that its joint is at `q`, until its supply goes. The drive must be disabled. Nothing: the protocol
// has no such frame.
std::optional<drivers::CanFrame> home_frame(const config::Joint& joint, double q);

// What to add to what the drive reads, by the robot file's offset, where the operator says the joint is at `at`: whole
// steps, or, of a drive that says nothing, anything. The error is why that is in doubt: no place within a quarter of a
// step, one that the joint or the drive cannot reach, or a reading as any that begins to count has it.
std::expected<double, std::string> shift_between(const config::Joint& joint, double read, double at);

// `at` is a place that the joint may have; else why not.
std::expected<void, std::string> check_place(const config::Joint& joint, double at);

}  // namespace takt::commissioning
