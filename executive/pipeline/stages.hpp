// SPDX-License-Identifier: Apache-2.0
// The stages of one tick over all joints, in the order control_tick calls them. Each reads what the earlier ones left
// in the state and in this tick's record, and writes its own share of both.
#pragma once

#include <span>

#include "executive/pipeline/choose.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

// Inputs into the record, replies into the observers and the bus watch, lateness counted.
void observe(TickState& state, const TickInput& input, const TickConfig& config, TickRecord& record);
// Position and velocity of every joint at `now`, what gravity asks there, and what torque leaves of the accelerations.
void estimate(TickState& state, const TickConfig& config, TickRecord& record);
// The message that arrived, the command in use, the contract, the causes, and the mode that follows from them.
void judge(TickState& state, const TickInput& input, const TickConfig& config, TickRecord& record);
// References: inside position, velocity and acceleration limits, and none from which the robot could not be stopped; of
// a step that is refused for that, neither feed-forward torque nor velocity setpoint is left in `targets`.
void constrain(TickState& state, const Choice& choice, std::span<JointTarget> targets, const TickConfig& config,
               TickRecord& record);
// Impedance law, barriers, torque limits: one setpoint per joint, and the damping in its place should
// it be too late for that.
void stabilise(const TickState& state, const Choice& choice, std::span<const JointTarget> targets,
               const TickConfig& config, TickOutput& output);
// The last clamp. Results that are not finite: internal_error, nothing leaves, fault latched if armed.
void clamp_output(TickState& state, const TickConfig& config, TickOutput& output);
// The observation, when one is due.
void publish(TickState& state, const Choice& choice, const TickConfig& config, TickOutput& output);
// Outcome into the record and the state of the next tick.
void record(TickState& state, const Choice& choice, const TickConfig& config, TickOutput& output);

// Changes the mode and does what entering it needs.
void enter(TickState& state, Mode mode, MonoTime now, const FreshnessContract& contract);

inline float period_seconds(const TickConfig& config) {
  return static_cast<float>(config.period.ns) * 1.0e-9F;
}

}  // namespace takt::pipeline
