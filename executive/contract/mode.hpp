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

constexpr std::string_view name(Cause cause) {
  constexpr std::array<std::string_view, kCauseCount> names{"none",
                                                            "operator_arm",
                                                            "operator_stop",
                                                            "operator_reset",
                                                            "shutdown",
                                                            "drives_enabled",
                                                            "enable_timeout",
                                                            "contract_violated",
                                                            "contract_restored",
                                                            "command_lost",
                                                            "bad_commands",
                                                            "feedback_lost",
                                                            "drive_fault",
                                                            "drive_disabled",
                                                            "bus_off",
                                                            "bus_down",
                                                            "bus_error_passive",
                                                            "transmit_queue_full",
                                                            "receive_overflow",
                                                            "replies_lost",
                                                            "replies_repeated",
                                                            "replies_delayed",
                                                            "foreign_node",
                                                            "bus_babble",
                                                            "envelope_exceeded",
                                                            "overrun",
                                                            "recording_lost",
                                                            "internal_error",
                                                            "operator_deenergise",
                                                            "torque_output_lost",
                                                            "tilt",
                                                            "imu_lost",
                                                            "fallback_spent",
                                                            "temperature_high",
                                                            "overtemperature",
                                                            "degraded_spent",
                                                            "feedback_implausible",
                                                            "following_error",
                                                            "following_lost",
                                                            "command_late"};
  const auto index = static_cast<std::size_t>(cause);
  return index < names.size() ? names[index] : "invalid";
}

}  // namespace takt
