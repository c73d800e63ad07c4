// SPDX-License-Identifier: Apache-2.0
// The 1 kHz decision, as a pure function: no clock, input, output, lock, allocation or random source inside.
//
// The same function runs in the real-time loop, in virtual time, in replay and under fuzzing; equal state, input and
// configuration give equal bits. TickInput carries everything a decision reads. Before any valid input the output
// is: standby, drives disabled, zero gains and torques.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/feedback.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

// What a command mailbox gave in this tick, not judged yet.
struct PolicyMessage {
  Arrival mailbox = Arrival::none;  // none, contended, corrupt, or accepted when `command` is there
  std::uint8_t session = 0;         // differs from the tick's before when another mailbox is read: sequences start over
  const CommandChunk* command = nullptr;  // a private copy, valid during the call only
  std::size_t bytes = 0;  // of the message; more than the largest legal one: only its beginning is there
  // Replay of a refused message whose values were not kept: what was found in them. None: look.
  Arrival values = Arrival::none;
};

struct TickInput {
  std::uint64_t tick = 0;
  MonoTime now;
  Duration lateness;
  Duration last_duration;
  std::uint64_t skipped_periods = 0;  // since start
  // For how long the computer was suspended since the tick before: the clock of `now` stood still meanwhile. 0: not.
  std::uint32_t slept_ms = 0;
  OverrunCause overrun_cause = OverrunCause::none;
  // What became of the previous tick at the edge: read just before its first frame (unset: nothing was sent), and the
  // joints to which it was too late for the setpoint, so that they got the damping.
  MonoTime last_sent_at;
  JointMask last_damped = 0;
  OperatorRequest operator_request = OperatorRequest::none;
  MonoTime asked_at;                   // when the executive heard a stop or shutdown; decides nothing
  std::uint64_t asked_policy = 0;      // of a swap: hash of the policy that is to play
  std::uint64_t recorded_through = 0;  // newest tick the recorder has on its medium; 0: nothing records
  TorqueOutputState torque_output = TorqueOutputState::none;  // what became of the previous tick's torque_permitted
  // Which of the policy's and the candidate's mailboxes is whose changes with in_charge of the tick before
  // (candidate.hpp). Empty where the robot has no fallback policy.
  PerSeat<PolicyMessage> messages;
  std::uint64_t candidate_policy = 0;  // hash of the candidate's mailbox, whichever policy is in charge; 0: none yet
  ImuSample imu;  // newest that was read, not judged yet; sequence 0: none yet, or the robot has none
  BusHealth buses[kMaxBuses];
  JointFeedback joints[kMaxJoints];
};

struct JointSetpoint {  // joint side; what the encoder turns into one drive's frame
  float q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
};

struct TickOutput {
  bool drives_enabled = false;
  bool torque_permitted = false;  // by the output that permits torque, where the robot has one
  bool observation_due = false;
  // When the command in use dies, for drive-side watchdogs: it is max_age old or its chunk is spent, whichever comes
  // first. Unset: none in use.
  MonoTime valid_until;
  MonoTime send_by;                     // a setpoint that leaves later is too old: `damping` goes out in its place
  bool drive_enabled[kMaxJoints] = {};  // false: that drive is told to de-energise
  JointSetpoint setpoints[kMaxJoints];
  // For a joint whose setpoint would come too late: the same drive, told to damp, within the torque and slew limits.
  JointSetpoint damping[kMaxJoints];
  Observation observation;  // meaningful when observation_due
  TickRecord record;        // this tick, inputs and outputs
};

// Opaque to callers; defined in tick_state.hpp. Plain value, about 910 KiB: keep it off the stack.
struct TickState;

struct TickStateDeleter {
  void operator()(TickState* state) const noexcept;
};
using TickStatePtr = std::unique_ptr<TickState, TickStateDeleter>;
TickStatePtr make_tick_state(const TickConfig& config);  // allocates; before the loop starts

void control_tick(TickState& state, const TickInput& input, const TickConfig& config, TickOutput& output) noexcept;

// What an operator still misses before arming can be granted; returns how many were written, 0 when nothing is missing.
// Pure.
inline constexpr std::string_view kDriveFaultBlocker = "the drive reports a fault";
struct ArmingBlocker {
  std::string_view what;      // "no fresh command: ...", "no recent feedback from the drive", ...
  std::int32_t joint = -1;    // -1: the whole robot
  Cause cause = Cause::none;  // of a bus
};
std::size_t arming_blockers(const TickRecord& latest, const TickConfig& config, std::span<ArmingBlocker> out) noexcept;

// Keyframes: the state's used part, so that replay can start anywhere. save returns the bytes written
// (out.size() >= kMaxKeyframeBytes always suffices); load refuses anything inconsistent with one sentence.
std::size_t save(const TickState& state, std::span<std::byte> out) noexcept;
// False: another version of the pipeline made it, or it is no keyframe.
bool is_of_this_layout(std::span<const std::byte> keyframe) noexcept;
std::expected<void, std::string> load(TickState& state, const TickConfig& config, std::span<const std::byte> bytes);

// To ask what another configuration would have decided, go on from a loaded state: `config` may remember more
// observations than the state was made for (a larger max_age), nothing else that has a size may differ.
void remember_more(TickState& state, const TickConfig& config) noexcept;

// Rebuilds the tick's input from its record (the commands, if any, are supplied by the caller).
TickInput input_of(const TickRecord& record, const CommandChunk* command, std::size_t command_bytes) noexcept;

}  // namespace takt::pipeline
