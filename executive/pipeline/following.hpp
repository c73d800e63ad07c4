// SPDX-License-Identifier: Apache-2.0
// Whether each joint follows its reference: following_error, and following_lost where the robot file stops for it.
// Pure.
//
// A joint is behind while it is further from its reference than JointConfig::following_error. Where none is given:
// while its stiffness asks for more than kFollowingShare of limits.torque, which is also as far as a reference may be
// from its joint (kept_near, reference_limits.hpp). A joint without stiffness is never behind, nor is one whose loop is
// closed by velocity and that has no following_error: its gains ask for no torque.
#pragma once

#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

inline constexpr float kFollowingShare = 0.9F;

// How far `joint` is from the reference of the tick before, as a share of what it may be: 1 at the limit. `q`: rad,
// where it is now. 0 where nothing limits it.
float following_share(const JointState& joint, float q, const JointConfig& config);

// Fills JointRecord::behind: 1 for the joints that have been behind for FollowingLimits::timeout. After the estimate,
// before the causes.
void watch_following(TickState& state, const TickConfig& config, TickRecord& record);

CauseMask following_conditions(const TickRecord& record, const TickConfig& config);

}  // namespace takt::pipeline
