// SPDX-License-Identifier: Apache-2.0
// Modes of the executive and the causes that move it between them. The reaction table lives in pipeline/mode_machine.
//
// mode           who enters                          drives meanwhile
// standby        start, operator reset               disabled; polled for feedback
// arming         operator arm                        being enabled; damping and gravity compensation where enabled
// tracking       every drive enabled, fresh command  impedance law on the played chunk
// degraded       command late, contract violated     as configured: hold, slow down, or a named fallback
// damped_stop    stop request, command lost, ...     damping and gravity compensation until the robot rests, then hold
// fault_latched  drive, bus or feedback fault        no power where the fault is, damping in what hangs there, the
//                                                    rest as in damped_stop; operator reset needed
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt {

enum class Mode : std::uint8_t { standby, arming, tracking, degraded, damped_stop, fault_latched };
inline constexpr std::size_t kModeCount = 6;

enum class Cause : std::uint8_t {
  none,
  operator_arm,         // person asks to arm
  operator_stop,        // person asks to stop
  operator_reset,       // person clears a latched stop or fault
  shutdown,             // SIGTERM / SIGINT: damped stop, then exit
  drives_enabled,       // every drive reports enabled
  enable_timeout,       // some drive did not enable in time
  contract_violated,    // evidence that more than epsilon of the ticks have no usable command
  contract_restored,    // fresh without interruption for long enough
  command_lost,         // no usable command for stop_after
  bad_commands,         // messages refused for what they say, or targets out of range, repeatedly: integration error
  feedback_lost,        // a joint's feedback is older than its limit
  drive_fault,          // a drive reports an error
  drive_disabled,       // a drive left the enabled state by itself
  bus_off,              // CAN controller bus-off
  bus_down,             // CAN interface down or gone
  bus_error_passive,    // CAN controller error-passive for too much of the time
  transmit_queue_full,  // our frames do not get out: dropped before or by the controller
  receive_overflow,     // frames lost on our side before they could be read
  replies_lost,         // a drive leaves too many commands unanswered
  replies_repeated,     // more replies than commands: a frame comes twice, or two drives answer
  replies_delayed,      // replies come in bunches, later than the tick they were due
  foreign_node,         // frames on our ids that are none of ours: a second controller, or a malformed answer
  bus_babble,           // more frames than our drives can say
  envelope_exceeded,    // measured position, velocity or torque outside the hard envelope
  overrun,              // too many periods of the window late or skipped
  recording_lost,       // a recorder is required, and none writes
  internal_error,       // our own bug: an assertion failed
  operator_deenergise,  // person wants the drives without power, now
  torque_output_lost,   // the output that permits torque does not do as it is told
  tilt,                 // the base leans or turns beyond its limits
  imu_lost,             // no usable sample of the base's IMU for its timeout
  fallback_spent,       // the fallback policy's time is over, or it sends invalid commands
  temperature_high,     // a drive is hotter than its joint's warning: told, or degraded by configuration
  overtemperature,      // a drive is hotter than its joint's limit
  degraded_spent,       // degraded for as long as the robot may be
  // What a drive tells of its joint's motion cannot be true.
  feedback_implausible,
  following_error,  // a joint is too far from its reference for too long: told, or degraded by configuration
  following_lost,   // the same, where the robot file stops the robot for it
  command_late,     // no usable command for degraded.after: a silence, which says nothing of how often
};
inline constexpr std::size_t kCauseCount = 40;

constexpr std::string_view name(Mode mode) {
  constexpr std::array<std::string_view, kModeCount> names{"standby",  "arming",      "tracking",
                                                           "degraded", "damped_stop", "fault_latched"};
  const auto index = static_cast<std::size_t>(mode);
  return index < names.size() ? names[index] : "invalid";
}

// Whom a cause speaks of: a person who wants something; drives or buses; the policy, the base, this computer.
enum class About : std::uint8_t { person, hardware, other };

struct CauseFacts {
  Cause cause;
  std::string_view name;
  About about;
  bool damps;  // the reaction table answers it with a damped stop, so that `stops` of a robot file may name it
};

inline constexpr std::array<CauseFacts, kCauseCount> kCauseFacts{{
    {Cause::none, "none", About::other, false},
    {Cause::operator_arm, "operator_arm", About::person, false},
    {Cause::operator_stop, "operator_stop", About::person, true},
    {Cause::operator_reset, "operator_reset", About::person, false},
    {Cause::shutdown, "shutdown", About::person, true},
    {Cause::drives_enabled, "drives_enabled", About::other, false},
    {Cause::enable_timeout, "enable_timeout", About::hardware, false},
    {Cause::contract_violated, "contract_violated", About::other, false},
    {Cause::contract_restored, "contract_restored", About::other, false},
    {Cause::command_lost, "command_lost", About::other, true},
    {Cause::bad_commands, "bad_commands", About::other, true},
    {Cause::feedback_lost, "feedback_lost", About::hardware, false},
    {Cause::drive_fault, "drive_fault", About::hardware, false},
    {Cause::drive_disabled, "drive_disabled", About::hardware, false},
    {Cause::bus_off, "bus_off", About::hardware, false},
    {Cause::bus_down, "bus_down", About::hardware, false},
    {Cause::bus_error_passive, "bus_error_passive", About::hardware, true},
    {Cause::transmit_queue_full, "transmit_queue_full", About::hardware, true},
    {Cause::receive_overflow, "receive_overflow", About::hardware, true},
    {Cause::replies_lost, "replies_lost", About::hardware, true},
    {Cause::replies_repeated, "replies_repeated", About::hardware, true},
    {Cause::replies_delayed, "replies_delayed", About::hardware, true},
    {Cause::foreign_node, "foreign_node", About::hardware, true},
    {Cause::bus_babble, "bus_babble", About::hardware, true},
    {Cause::envelope_exceeded, "envelope_exceeded", About::other, true},
    {Cause::overrun, "overrun", About::other, true},
    {Cause::recording_lost, "recording_lost", About::other, true},
    {Cause::internal_error, "internal_error", About::other, false},
    {Cause::operator_deenergise, "operator_deenergise", About::person, false},
    {Cause::torque_output_lost, "torque_output_lost", About::other, true},
    {Cause::tilt, "tilt", About::other, true},
    {Cause::imu_lost, "imu_lost", About::other, true},
    {Cause::fallback_spent, "fallback_spent", About::other, true},
    {Cause::temperature_high, "temperature_high", About::other, false},
    {Cause::overtemperature, "overtemperature", About::hardware, true},
    {Cause::degraded_spent, "degraded_spent", About::other, true},
    {Cause::feedback_implausible, "feedback_implausible", About::hardware, false},
    {Cause::following_error, "following_error", About::other, false},
    {Cause::following_lost, "following_lost", About::other, true},
    {Cause::command_late, "command_late", About::other, false},
}};

constexpr std::string_view name(Cause cause) {
  const auto index = static_cast<std::size_t>(cause);
  return index < kCauseFacts.size() ? kCauseFacts[index].name : "invalid";
}

static_assert([] {
  for (std::size_t i = 0; i < kCauseCount; ++i)
    if (kCauseFacts[i].cause != Cause{static_cast<std::uint8_t>(i)}) return false;
  return true;
}());

}  // namespace takt
