// SPDX-License-Identifier: Apache-2.0
// How long each cause of the reaction table takes from the instant at which something deviates to the last frame of the
// tick that reacts, in virtual time: the executive's own loop, drivers and guard in front of simulated drives.
// Deterministic: the same robot file gives the same figures.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::exploration {

struct ReactionTime {
  Cause cause = Cause::none;
  std::string_view from;  // the instant that it is counted from
  Duration worst;         // on each joint or bus that can be struck, at instants spread over a period
  // What the table's bound is for this robot and strike: finding it, two ticks, and what the world takes to show it.
  // None: it comes by chance.
  std::optional<Duration> bound;
};

// Of every cause that stops the robot or takes its trust in the policy, in the order of the reaction table. The error:
// a strike that its cause did not answer, or not within its bound.
std::expected<std::vector<ReactionTime>, std::string> measure_reaction_times(const config::RobotConfig& robot);

}  // namespace takt::exploration
