// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/control_tick.hpp"

#include <algorithm>
#include <array>

#include "executive/pipeline/brake.hpp"
#include "executive/pipeline/stages.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {
namespace {

// References stand so that one step at the target's own pace ends on it: nothing is left to pursue.
void jump_to_targets(TickState& state, const Choice& choice, std::span<const JointTarget> targets,
                     const TickConfig& config) {
  if (choice.reference != Reference::follow_target) return;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const auto q = static_cast<double>(targets[j].q), dq = static_cast<double>(targets[j].dq);
    if (targets[j].part == Part::as_chosen) state.joints[j].reference = {q - dq * config.period.seconds(), dq, 0.0};
  }
}

}  // namespace

void control_tick(TickState& state, const TickInput& input, const TickConfig& config, TickOutput& output) noexcept {
  std::array<JointTarget, kMaxJoints> targets;  // uninitialised: choose fills joint_count entries
  observe(state, input, config, output.record);
  estimate(state, config, output.record);
  judge(state, input, config, output.record);
  Choice choice = choose(state, output.record, config, targets);
  if (config.without.barriers) choice.barriers = false;
  if (config.without.pursuit) jump_to_targets(state, choice, targets, config);
  constrain(state, choice, targets, config, output.record);
  stabilise(state, choice, targets, config, output);
  clamp_output(state, config, output);
  publish(state, choice, config, output);
  record(state, choice, config, output);
}

TickInput input_of(const TickRecord& record, const CommandChunk* command, std::size_t command_bytes) noexcept {
  const TickRecordHeader& header = record.header;
  TickInput input;
  input.tick = header.tick;
  input.now = header.now;
  input.lateness = header.lateness;
  input.last_duration = header.last_duration;
  input.skipped_periods = header.skipped_periods;
  input.slept_ms = header.slept_ms;
  input.overrun_cause = header.overrun_cause;
  input.last_sent_at = header.last_sent_at;
  input.last_damped = header.last_damped;
  input.operator_request = header.operator_request;
  input.asked_at = header.asked_at;
  input.recorded_through = header.recorded_through;
  input.torque_output = header.torque_output;
  input.imu = header.imu;
  for (const Seat seat : kSeats) {
    input.messages[seat].mailbox = header.seats[seat].mailbox;
    input.messages[seat].session = header.seats[seat].session;
  }
  input.candidate_policy = header.candidate.policy_hash;
  input.asked_policy = header.candidate.asked_policy;
  input.messages[Seat::policy].command = command;
  input.messages[Seat::policy].bytes = command == nullptr ? 0 : command_bytes;
  std::copy_n(header.buses, kMaxBuses, input.buses);
  for (std::size_t j = 0; j < header.joint_count && j < kMaxJoints; ++j) input.joints[j] = record.joints[j].feedback;
  return input;
}

TickStatePtr make_tick_state(const TickConfig& config) {
  TickStatePtr state(new TickState{});
  state->shape = {config.joint_count, config.freshness.window_ticks, remembered_observations(config)};
  state->gravity = GravityModel(config);
  state->limbs = Limbs(config);
  state->scarce = scarce_joints(config, state->gravity);
  return state;
}

void TickStateDeleter::operator()(TickState* state) const noexcept {
  delete state;
}

}  // namespace takt::pipeline
