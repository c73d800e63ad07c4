// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/causes.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "executive/pipeline/bus_watch.hpp"
#include "executive/pipeline/following.hpp"
#include "executive/pipeline/imu_watch.hpp"
#include "executive/pipeline/joint_watch.hpp"

namespace takt::pipeline {
namespace {

constexpr CauseMask when(bool holds, Cause cause) {
  return holds ? bit(cause) : 0;
}

bool is_outside_hard_envelope(const JointRecord& joint, const JointLimits& limits) {
  const bool is_outlier = (joint.reply_faults & bit(ReplyFault::outlier)) != 0;
  const float q = is_outlier ? joint.q_estimate : joint.feedback.q;
  return q < limits.q_min - limits.q_hard_margin || q > limits.q_max + limits.q_hard_margin ||
         std::abs(joint.dq_estimate) > limits.velocity_hard;
}

bool is_lost(const TickState& state, std::size_t j, const TickRecord& record, const TickConfig& config) {
  const JointState& joint = state.joints[j];
  return !is_heard(joint.observer, record.header.now, config.feedback_timeout + joint.stood_still);
}

bool is_faulty(const JointRecord& joint) {
  return joint.feedback.drive_state == DriveState::fault || joint.feedback.error_code != 0;
}

bool is_implausible(const JointRecord& joint) {
  return (joint.reply_faults & kImplausible) != 0;
}

// Not because we took its power away.
bool disabled_itself(const TickState& state, std::size_t j, const JointRecord& joint) {
  return joint.feedback.drive_state == DriveState::disabled && (state.mode.deenergised & bit_of_joint(j)) == 0;
}

bool is_cut_off(const BusHealth& bus) {
  return bus.state == BusState::bus_off || bus.state == BusState::down;
}

struct DriveSummary {
  bool any_lost = false, any_implausible = false, any_fault = false, any_disabled = false, any_outside = false,
       all_enabled = true;
};

DriveSummary summarise(const TickState& state, const TickRecord& record, const TickConfig& config) {
  DriveSummary sum;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointRecord& joint = record.joints[j];
    const bool seen = state.joints[j].observer.sampled_at.is_set();
    sum.any_lost |= is_lost(state, j, record, config);
    sum.any_implausible |= is_implausible(joint);
    sum.any_fault |= is_faulty(joint);
    sum.any_disabled |= disabled_itself(state, j, joint);
    sum.all_enabled &= joint.feedback.drive_state == DriveState::enabled;
    sum.any_outside |= seen && !config.without.envelope && is_outside_hard_envelope(joint, config.joints[j].limits);
  }
  return sum;
}

// A frame that breaks the contract comes from a fault of ours, whatever joint it was for.
CauseMask of_guard(const TickRecord& record) {
  const bool broken = std::any_of(record.joints, record.joints + record.header.joint_count,
                                  [](const JointRecord& joint) { return is_bug(joint.feedback.refused); });
  return when(broken, Cause::internal_error);
}

// Of those that have drives: on another nothing is sent, so that its return would stay unseen.
CauseMask of_buses(const TickRecord& record, const TickConfig& config) {
  CauseMask active = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const BusState state = record.header.buses[config.joints[j].bus].state;
    active |= when(state == BusState::bus_off, Cause::bus_off) | when(state == BusState::down, Cause::bus_down);
  }
  return active;
}

CauseMask of_drives(const TickState& state, const TickRecord& record, const TickConfig& config) {
  const DriveSummary sum = summarise(state, record, config);
  const bool arming = state.mode.mode == Mode::arming;
  // Tracking begins with a usable command only; until then arming waits, within enable_timeout.
  const bool ready = sum.all_enabled && is_usable(record.header.seats[Seat::policy].freshness);
  return when(sum.any_lost, Cause::feedback_lost) | when(sum.any_implausible, Cause::feedback_implausible) |
         when(sum.any_fault, Cause::drive_fault) |
         when(sum.any_disabled && (state.mode.drives_enabled != 0 || is_latched(state.mode.mode)),
              Cause::drive_disabled) |
         when(sum.any_outside, Cause::envelope_exceeded) | when(arming && ready, Cause::drives_enabled) |
         when(arming && !ready && record.header.now - state.mode.armed_at > config.enable_timeout,
              Cause::enable_timeout);
}

// What has moved, or could have moved, the robot in its present mode.
MonoTime last_usable_at(const TickState& state, const TickConfig& config) {
  const bool may_take_over = state.mode.mode == Mode::degraded && has_fallback_policy(config);
  const MonoTime of_policy = state.recovery.last_usable_at;
  return may_take_over ? std::max(of_policy, state.fallback.last_usable_at) : of_policy;
}

bool is_out_of_range(const TickWindow& clamped, const TickConfig& config) {
  return static_cast<double>(clamped.count()) > config.clamped_share * config.freshness.window_ticks;
}

// The fallback policy's time is over, or it sends invalid commands: no other policy can take over, so it is not the
// policy's bad_commands, which a stop may leave to the fallback.
bool is_fallback_spent(const TickState& state, MonoTime now, const TickConfig& config) {
  const MonoTime since = state.fallback.plays_since;
  const bool is_over = config.fallback_longest > Duration{} && since.is_set() && now - since >= config.fallback_longest;
  return is_over || is_out_of_range(state.fallback_clamped, config);
}

// A drive that made the robot stop, or degraded it, has to cool by this much before the condition is gone.
constexpr float kCooler_C = 5;

bool is_hotter(const JointFeedback& feedback, float limit, float casing_limit, float sooner) {
  return (limit > 0 && feedback.temperature_C > limit - sooner) ||
         (casing_limit > 0 && static_cast<float>(feedback.casing_C) > casing_limit - sooner);
}

CauseMask of_temperatures(const TickRecord& record, Mode mode, const TickConfig& config) {
  const float to_warn = mode == Mode::degraded ? kCooler_C : 0;
  const float to_stop = mode == Mode::standby || is_latched(mode) ? kCooler_C : 0;
  bool high = false, over = false;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const TemperatureLimits& limits = config.joints[j].temperature;
    const JointFeedback& feedback = record.joints[j].feedback;
    high |= is_hotter(feedback, limits.warning, limits.casing_warning, to_warn);
    over |= is_hotter(feedback, limits.stop, limits.casing_stop, to_stop);
  }
  return when(high, Cause::temperature_high) | when(over, Cause::overtemperature);
}

bool is_degraded_spent(const ModeState& mode, MonoTime now, const TickConfig& config) {
  return config.degraded_longest > Duration{} && mode.degraded_since.is_set() &&
         now - mode.degraded_since >= config.degraded_longest;
}

// What keeps the robot degraded, however fresh its commands are.
bool stays_degraded(CauseMask active, const TickConfig& config) {
  const CauseMask degrades = (config.temperature_degrades ? bit(Cause::temperature_high) : 0) |
                             (config.following.then == FollowingReaction::degrade ? bit(Cause::following_error) : 0);
  return (active & degrades) != 0;
}

CauseMask of_commands(const TickState& state, MonoTime now, const TickConfig& config) {
  const FreshnessContract& contract = config.freshness;
  const bool out_of_range = is_out_of_range(state.clamped, config);
  CauseMask active = when(out_of_range || state.refusals.count() > contract.bad_command_limit, Cause::bad_commands);
  const Mode mode = state.mode.mode;
  if (mode == Mode::damped_stop) return active | when(is_fallback_spent(state, now, config), Cause::fallback_spent);
  const bool counting = mode == Mode::tracking || mode == Mode::degraded;
  if (!counting && mode != Mode::arming) return active;
  active |= when(is_command_lost(last_usable_at(state, config), now, contract), Cause::command_lost);
  active |= when(counting && is_violated(state.recovery, contract), Cause::contract_violated) |
            when(counting && is_late(state.recovery, now, contract), Cause::command_late);
  active |= when(is_fallback_spent(state, now, config), Cause::fallback_spent) |
            when(is_degraded_spent(state.mode, now, config), Cause::degraded_spent);
  return active | when(mode == Mode::degraded && is_restored(state.recovery, now, contract), Cause::contract_restored);
}

// Silent for long enough to be given up. After a suspend every joint is lost at once, and has to be asked first.
bool is_silent(const TickState& state, std::size_t j, const TickRecord& record, const TickConfig& config) {
  const JointState& joint = state.joints[j];
  const MonoTime heard_at = std::max(joint.observer.sampled_at, state.mode.awake_since);
  return !heard_at.is_set() || record.header.now - heard_at > config.feedback_timeout + joint.stood_still;
}

// Before it was told anything, nothing is known of it: doubt forbids arming.
bool is_torque_output_lost(const TickRecordHeader& header, const TickConfig& config) {
  return config.has_torque_output && header.torque_output != TorqueOutputState::as_told;
}

// The record rings keep for a while what the recorder has not written yet, so it may be behind, but not by more than it
// can make good. A tick that has not happened cannot have been written.
bool is_unrecorded(const TickRecordHeader& header, const TickConfig& config) {
  if (config.unrecorded_limit == 0) return false;
  const std::uint64_t written = header.recorded_through;
  return written == 0 || written > header.tick || header.tick - written > config.unrecorded_limit;
}

}  // namespace

CauseMask conditions(const TickState& state, const TickRecord& record, const TickConfig& config) {
  const bool late = static_cast<double>(state.late.count()) > config.late_share * config.freshness.window_ticks;
  const CauseMask temperatures = of_temperatures(record, state.mode.mode, config);
  const CauseMask following = following_conditions(record, config);
  const CauseMask withheld = stays_degraded(temperatures | following, config) ? bit(Cause::contract_restored) : 0;
  const CauseMask commands = of_commands(state, record.header.now, config) & ~withheld;
  return of_buses(record, config) | link_faults(state.links, record, config) | of_drives(state, record, config) |
         commands | temperatures | following | of_guard(record) | when(late, Cause::overrun) |
         when(is_unrecorded(record.header, config), Cause::recording_lost) |
         when(is_torque_output_lost(record.header, config), Cause::torque_output_lost) |
         imu_conditions(state.imu, record.header.now, config.imu);
}

JointMask affected_joints(const TickState& state, const TickRecord& record, const TickConfig& config) {
  const Mode mode = state.mode.mode;
  const bool was_enabled = state.mode.drives_enabled != 0 || mode == Mode::fault_latched;
  JointMask affected = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointRecord& joint = record.joints[j];
    const bool not_yet = mode == Mode::arming && joint.feedback.drive_state != DriveState::enabled;
    if (is_silent(state, j, record, config) || is_implausible(joint) || is_faulty(joint) || not_yet ||
        (was_enabled && disabled_itself(state, j, joint)) || is_cut_off(record.header.buses[config.joints[j].bus]))
      affected |= bit_of_joint(j);
  }
  return affected;
}

CauseMask granted_request(const TickState& state, const TickRecord& record, CauseMask active,
                          const TickConfig& config) {
  switch (record.header.operator_request) {
    case OperatorRequest::none:
    case OperatorRequest::mark:
    case OperatorRequest::swap:
    case OperatorRequest::back:
      return 0;
    case OperatorRequest::arm: {
      std::array<ArmingBlocker, 1> first;
      return when(arming_blockers(record, config, first) == 0, Cause::operator_arm);
    }
    case OperatorRequest::stop:
      return bit(Cause::operator_stop);
    case OperatorRequest::press_stop: {
      const MonoTime pressed = state.mode.stop_pressed_at;
      const bool again = pressed.is_set() && record.header.now - pressed >= kStopAgainAfter;
      return bit(again ? Cause::operator_deenergise : Cause::operator_stop);
    }
    case OperatorRequest::deenergise:
      return bit(Cause::operator_deenergise);
    case OperatorRequest::reset: {
      const bool fault_holds = state.mode.mode == Mode::fault_latched && (active & kLastingFaults) != 0;
      const bool is_let_go = state.mode.player != Player::fallback;  // standing still is no rest
      return when(is_let_go && state.mode.rest_of_all.rests(record.header.now) && !fault_holds, Cause::operator_reset);
    }
    case OperatorRequest::shutdown:
      return bit(Cause::shutdown);
  }
  return 0;
}

}  // namespace takt::pipeline
