// SPDX-License-Identifier: Apache-2.0
// The causes that `stops` of a robot file may name: those that the executive's table answers with a damped stop
// (executive/setup/tick_config_of.cpp asserts that the two agree).
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

#include "executive/contract/mode.hpp"

namespace takt::config {

inline constexpr std::array kStopCauses{Cause::operator_stop,
                                        Cause::shutdown,
                                        Cause::command_lost,
                                        Cause::bad_commands,
                                        Cause::bus_error_passive,
                                        Cause::transmit_queue_full,
                                        Cause::receive_overflow,
                                        Cause::replies_lost,
                                        Cause::replies_repeated,
                                        Cause::replies_delayed,
                                        Cause::foreign_node,
                                        Cause::bus_babble,
                                        Cause::envelope_exceeded,
                                        Cause::overrun,
                                        Cause::recording_lost,
                                        Cause::torque_output_lost,
                                        Cause::tilt,
                                        Cause::imu_lost,
                                        Cause::fallback_spent,
                                        Cause::overtemperature,
                                        Cause::degraded_spent,
                                        Cause::following_lost};

// Those of them that may leave the robot to its fallback policy: what makes them hurts neither drives nor feedback, nor
// what that policy sees, and none of them is worse than a person's stop.
inline constexpr std::array kPolicyStopCauses{Cause::operator_stop, Cause::bad_commands, Cause::overrun};

// Cause::none: no such cause.
constexpr Cause stop_cause_named(std::string_view word) {
  const auto found = std::ranges::find_if(kStopCauses, [&](Cause cause) { return name(cause) == word; });
  return found == kStopCauses.end() ? Cause::none : *found;
}

}  // namespace takt::config
