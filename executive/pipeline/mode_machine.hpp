// SPDX-License-Identifier: Apache-2.0
// Cause -> reaction, in one place. Each row says how severe the cause is, which mode it leads to from each mode
// (the mode itself: no reaction there), how far and how hard it stops, within which bound, what clears it, and what is
// said where it blocks arming. Of all causes that hold in a tick, the most severe one that reacts in the present mode
// decides.
//
// Stops have a scope: the joints that the cause is about, what hangs on them (limbs.hpp), the rest of the robot; and a
// category, as IEC 60204-1 names them:
//   0  power is taken away at once
//   1  brought to rest, then power is taken away
//   2  brought to rest, power stays: what hangs on a lost joint damps, without the gravity model, whose pose is no
//      longer sure; a joint between the base and a lost one brakes and holds its own position; the rest of the robot
//      damps with gravity carried until it rests, then holds its position
// Bounds count from the tick that finds the condition to the frames that react; what finding takes is named in front.
//
// Requests and faults enter as causes; whether a request is granted (arming blockers, rest before a reset) is judged
// before it becomes a cause: see causes.hpp.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "executive/contract/mode.hpp"

namespace takt::pipeline {

using CauseMask = std::uint64_t;

constexpr CauseMask bit(Cause cause) {
  return CauseMask{1} << static_cast<unsigned>(cause);
}

enum class Stop : std::uint8_t {
  none,
  category_0,
  category_1,
  category_2_damping,  // category 2 that trusts no model: damps for ever, and sags
  category_2,
};

struct Scope {
  Stop joints = Stop::none;   // that the cause is about
  Stop hanging = Stop::none;  // what hangs on those
  Stop robot = Stop::none;    // the rest of it
};

struct Reaction {
  Cause cause = Cause::none;
  std::uint8_t severity = 0;          // unique among causes that react
  std::array<Mode, kModeCount> to{};  // from standby, arming, tracking, degraded, damped_stop, fault_latched
  Scope stops{};                      // all none: no stop
  std::string_view bound;             // empty: no stop
  std::string_view clears_when;
  std::string_view blocks_arming{};  // what an arming is refused with while it holds; empty: it blocks none
  [[nodiscard]] constexpr Mode from(Mode mode) const { return to[static_cast<std::size_t>(mode)]; }
};

namespace reaction_detail {
inline constexpr Mode S = Mode::standby, A = Mode::arming, T = Mode::tracking, D = Mode::degraded,
                      P = Mode::damped_stop, F = Mode::fault_latched;
inline constexpr Scope kNo{}, kRest{.robot = Stop::category_2}, kEnd{.robot = Stop::category_1},
    kOff{.robot = Stop::category_0}, kLoss{Stop::category_0, Stop::category_2_damping, Stop::category_2},
    kSag{.robot = Stop::category_2_damping};
}  // namespace reaction_detail

// clang-format off
inline constexpr std::array<Reaction, kCauseCount> kReactions = [] {
  using namespace reaction_detail;
  return std::array<Reaction, kCauseCount>{{
    // cause                    severity  S  A  T  D  P  F   stops  bound, clears when, blocks arming
    {Cause::none,                  0,  {S, A, T, D, P, F}, kNo,   "",
      "always"},
    {Cause::operator_arm,         10,  {A, A, T, D, P, F}, kNo,   "",
      "request, one tick; granted when nothing blocks arming"},
    {Cause::operator_stop,        60,  {S, P, P, P, P, F}, kRest, "one tick",
      "takt reset, once the robot rests"},
    {Cause::operator_reset,        5,  {S, A, T, D, S, S}, kNo,   "",
      "request, one tick; granted at rest, unless a joint is silent or implausible, or a bus off or down"},
    {Cause::shutdown,             61,  {S, P, P, P, P, F}, kEnd,  "one tick; power off at rest, after 10 s at most",
      "never: the process ends"},
    {Cause::drives_enabled,       15,  {S, T, T, D, P, F}, kNo,   "",
      "the tick after"},
    {Cause::enable_timeout,       70,  {S, F, T, D, P, F}, kLoss, "feedback.enable_timeout, one tick",
      "takt reset"},
    {Cause::contract_violated,    30,  {S, A, D, D, P, F}, kNo,   "",
      "the mode is left; mode: contract_restored"},
    {Cause::contract_restored,    20,  {S, A, T, T, P, F}, kNo,   "",
      "the tick after"},
    {Cause::command_lost,         50,  {S, P, P, P, P, F}, kRest, "freshness.stop_after, one tick",
      "takt reset; arming waits for a usable command"},
    {Cause::bad_commands,         55,  {S, P, P, P, P, F}, kRest,
      "freshness.bad_command_limit messages or freshness.clamped_share of the window, one tick",
      "refusals and clamped ticks in the window fall to their limits; then takt reset",
      "commands are being refused"},
    {Cause::feedback_lost,        80,  {S, F, F, F, F, F}, kLoss, "feedback.timeout, one tick",
      "every joint replies again; then takt reset"},
    {Cause::drive_fault,          85,  {S, F, F, F, F, F}, kLoss, "one tick",
      "the drive says so once it is disabled; then takt reset; blocks arming until clear"},
    {Cause::drive_disabled,       75,  {S, A, F, F, F, F}, kLoss, "one tick",
      "takt reset"},
    {Cause::bus_off,              90,  {S, F, F, F, F, F}, kLoss, "one tick",
      "the controller left bus-off, by itself or by takt bus up; then takt reset",
      "a CAN bus is off"},
    {Cause::bus_down,             91,  {S, F, F, F, F, F}, kLoss, "one tick",
      "the interface is up; then takt reset",
      "a CAN interface is down"},
    // Bus faults that still let us steer: a damped stop, while that is true. Severity: the nearer to the root, the higher.
    {Cause::bus_error_passive,    59,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "its share of the window falls to the limit; then takt reset",
      "a CAN controller is error-passive: check cable, termination and bit rate"},
    {Cause::transmit_queue_full,  66,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "drops in the window fall to the limit; then takt reset",
      "a CAN bus does not take our frames: is another node there to acknowledge them?"},
    {Cause::receive_overflow,     67,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "drops in the window fall to the limit; then takt reset",
      "frames of a CAN bus are lost on this computer: is it overloaded?"},
    {Cause::replies_lost,         64,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "losses in the window fall to the limit; then takt reset"},
    {Cause::replies_repeated,     63,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "repetitions in the window fall to the limit; then takt reset"},
    {Cause::replies_delayed,      62,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "delays in the window fall to the limit; then takt reset"},
    {Cause::foreign_node,         69,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "foreign frames in the window fall to the limit; then takt reset",
      "strange frames on our drives' ids: is a second controller on the bus?"},
    {Cause::bus_babble,           68,  {S, P, P, P, P, F}, kRest, "bus_faults.window, one tick",
      "flooded ticks in the window fall to the limit; then takt reset",
      "a CAN bus carries more frames than our drives can say"},
    {Cause::envelope_exceeded,    65,  {S, P, P, P, P, F}, kRest, "one tick",
      "position and speed inside the hard envelope; then takt reset"},
    {Cause::overrun,              58,  {S, P, P, P, P, F}, kRest, "control.late_share of the window, one tick",
      "late and skipped periods in the window fall to the limit; then takt reset",
      "the control loop is late too often"},
    {Cause::recording_lost,       57,  {S, P, P, P, P, F}, kRest, "the recorder's end, or 4096 ticks without its word, one tick",
      "the recorder writes again; then takt reset",
      "nothing is recorded: start takt-monitor, or see why it stopped (record.recorder: optional moves unrecorded)"},
    {Cause::internal_error,      100,  {S, F, F, F, F, F}, kSag, "the same tick",
      "takt reset; report it",
      "internal error"},
    // Above every fault, our own bugs included: a person who wants no power gets none.
    {Cause::operator_deenergise, 110,  {S, S, S, S, S, S}, kOff,  "one tick",
      "request, one tick; granted always"},
    // The drives still hear us, so the robot comes to rest while it has torque; then arming is refused.
    {Cause::torque_output_lost,   56,  {S, P, P, P, P, F}, kRest, "one tick",
      "the output does as it is told; then takt reset",
      "the output that permits torque does not do as it is told (safety.safe_torque_off)"},
    {Cause::tilt,                 54,  {S, P, P, P, P, F}, kRest, "one tick",
      "the base is upright and still within imu.tilt and imu.angular_velocity; then takt reset",
      "the base leans or turns beyond its limits (imu)"},
    // What is commanded next would be decided by an unknown attitude.
    {Cause::imu_lost,             53,  {S, P, P, P, P, F}, kRest, "the IMU sensor's timeout, one tick",
      "a usable sample; then takt reset",
      "no usable sample of the base's IMU: is its process running? takt status says what is wrong with it"},
    {Cause::fallback_spent,       51,  {S, A, T, P, P, F}, kRest, "fallbacks.NAME.for or freshness.clamped_share of the window, one tick",
      "the policy's contract is restored, or the mode left; then takt reset"},
    // A warning, unless the robot file wants the robot degraded by it.
    {Cause::temperature_high,     31,  {S, A, D, D, P, F}, kNo,   "",
      "every drive is 5 degrees cooler than its warning; mode: contract_restored"},
    {Cause::overtemperature,      52,  {S, P, P, P, P, F}, kRest, "one tick",
      "every drive is 5 degrees cooler than its limit; then takt reset",
      "a drive is too hot, or has not cooled by 5 degrees yet (limits.temperature)"},
    {Cause::degraded_spent,       49,  {S, A, T, P, P, F}, kRest, "degraded.for, one tick",
      "the mode is left; then takt reset"},
    // Such a joint's position is unknown: as if it were silent.
    {Cause::feedback_implausible, 82,  {S, F, F, F, F, F}, kLoss, "feedback.frozen_after or three replies, one tick",
      "every joint's feedback was plausible for 0.5 s; then takt reset"},
    // A warning, unless the robot file wants the robot degraded by it.
    {Cause::following_error,      29,  {S, A, D, D, P, F}, kNo,   "",
      "every joint is within limits.following_error of its reference; mode: contract_restored"},
    {Cause::following_lost,       48,  {S, A, P, P, P, F}, kRest, "feedback.following_timeout, one tick",
      "every joint is within limits.following_error of its reference; then takt reset"},
    {Cause::command_late,         28,  {S, A, D, D, P, F}, kNo,   "",
      "a usable command; mode: contract_restored"},
  }};
}();
// clang-format on

constexpr const Reaction& reaction(Cause cause) {
  return kReactions[static_cast<std::size_t>(cause)];
}

// A latched mode is left by the operator only.
constexpr bool is_latched(Mode mode) {
  return mode == Mode::damped_stop || mode == Mode::fault_latched;
}

struct Transition {
  Mode to = Mode::standby;
  Cause cause = Cause::none;  // none: no transition
};

// `warnings`: causes that the robot file wants told and nothing more. Only those that stop nothing can be.
constexpr Transition decide(Mode mode, CauseMask active, CauseMask warnings = 0) {
  Transition worst{mode, Cause::none};
  std::uint8_t worst_severity = 0;
  for (CauseMask left = active & ~warnings & ((CauseMask{1} << kCauseCount) - 1); left != 0; left &= left - 1) {
    const Reaction& row = kReactions[static_cast<std::size_t>(std::countr_zero(left))];
    if (row.from(mode) == mode || row.severity <= worst_severity) continue;
    worst = {row.from(mode), row.cause};
    worst_severity = row.severity;
  }
  return worst;
}

// Those that may lead to a damped stop, from wherever.
constexpr bool may_damp(const Reaction& row) {
  return row.stops.robot != Stop::none &&
         (row.from(Mode::tracking) == Mode::damped_stop || row.from(Mode::degraded) == Mode::damped_stop);
}

// The worst of those that may lead to a damped stop, `present` among them.
constexpr Cause worst_stop(Cause present, CauseMask active) {
  for (CauseMask left = active & ((CauseMask{1} << kCauseCount) - 1); left != 0; left &= left - 1) {
    const Reaction& row = kReactions[static_cast<std::size_t>(std::countr_zero(left))];
    if (may_damp(row) && row.severity > kReactions[static_cast<std::size_t>(present)].severity) present = row.cause;
  }
  return present;
}

// By whose manner a damped stop goes on: a worse cause takes over from the one that began it. `by_policy`: causes that
// leave the robot to its fallback policy. Any other cause ends that, however mild it is, and none of them begins it in
// a stop that goes on: a released joint stays released.
constexpr Cause stopped_by(Cause present, CauseMask active, CauseMask by_policy = 0) {
  if ((by_policy & bit(present)) == 0) return worst_stop(present, active & ~by_policy);
  const Cause other = worst_stop(Cause::none, active & ~by_policy);
  return other != Cause::none ? other : worst_stop(present, active);
}

// Conditions that must be gone before a latched fault may be reset. A drive's own fault is not among them: disabling
// the drive, which is what standby does, clears it; until it is clear it blocks arming.
inline constexpr CauseMask kLastingFaults =
    bit(Cause::feedback_lost) | bit(Cause::feedback_implausible) | bit(Cause::bus_off) | bit(Cause::bus_down);

namespace reaction_detail {
constexpr bool rows_are_in_order() {
  for (std::size_t i = 0; i < kCauseCount; ++i)
    if (static_cast<std::size_t>(kReactions[i].cause) != i || kReactions[i].clears_when.empty()) return false;
  return true;
}
constexpr bool severities_differ() {
  for (std::size_t i = 0; i < kCauseCount; ++i)
    for (std::size_t k = i + 1; k < kCauseCount; ++k)
      if (kReactions[i].severity == kReactions[k].severity) return false;
  return true;
}
constexpr bool only(Cause cause, Mode from, Mode to) {
  for (const Reaction& row : kReactions)
    if (row.from(from) != from && row.from(from) == to && row.cause != cause) return false;
  return true;
}
constexpr bool standby_is_left_by_arming_only() {
  for (const Reaction& row : kReactions)
    if (row.from(S) != S && !(row.cause == Cause::operator_arm && row.from(S) == A)) return false;
  return true;
}
constexpr bool is_persons_way_out(Cause cause) {
  return cause == Cause::operator_reset || cause == Cause::operator_deenergise;
}
constexpr bool latched_modes_never_rearm() {
  for (const Reaction& row : kReactions)
    for (const Mode mode : {P, F})
      if (const Mode to = row.from(mode); !is_latched(to) && !(to == S && is_persons_way_out(row.cause))) return false;
  return true;
}
constexpr bool deenergising_always_wins() {
  const Reaction& wins = kReactions[static_cast<std::size_t>(Cause::operator_deenergise)];
  for (const Reaction& row : kReactions)
    if (row.cause != wins.cause && row.severity >= wins.severity) return false;
  for (const Mode mode : {S, A, T, D, P, F})
    if (wins.from(mode) != S) return false;
  return true;
}
constexpr bool faults_never_heal_into_a_stop() {
  for (const Reaction& row : kReactions)
    if (row.from(F) == P) return false;
  return true;
}
constexpr bool leads_to(const Reaction& row, Mode mode) {
  for (std::size_t from = 0; from < kModeCount; ++from)
    if (static_cast<Mode>(from) != mode && row.to[from] == mode) return true;
  return false;
}
// Whatever ends in a latched mode, or takes an armed robot to standby, stops the whole robot, in a bound; nothing else
// does.
constexpr bool latched_modes_are_stops() {
  for (const Reaction& row : kReactions) {
    const bool stops = leads_to(row, P) || leads_to(row, F) || row.from(T) == S;
    if (stops != (row.stops.robot != Stop::none) || stops == row.bound.empty()) return false;
  }
  return true;
}
// The nearer to the cause, the harder; power is taken from joints by a latched fault only, which keeps it away.
constexpr bool scopes_are_nested() {
  for (const Reaction& row : kReactions) {
    const auto [joints, hanging, robot] = row.stops;
    if (joints != Stop::none && (hanging < joints || robot < hanging || !leads_to(row, F))) return false;
    if ((joints == Stop::none) != (hanging == Stop::none)) return false;
  }
  return true;
}
// A cause may be made a warning only where it stops nothing.
inline constexpr CauseMask kMayWarn = bit(Cause::temperature_high) | bit(Cause::following_error);
constexpr bool warnings_stop_nothing() {
  for (const Reaction& row : kReactions)
    if ((kMayWarn & bit(row.cause)) != 0 && row.stops.robot != Stop::none) return false;
  return true;
}
static_assert(rows_are_in_order());
static_assert(warnings_stop_nothing());
static_assert(latched_modes_are_stops());
static_assert(scopes_are_nested());
static_assert(severities_differ());
static_assert(standby_is_left_by_arming_only());
static_assert(only(Cause::drives_enabled, A, T) && only(Cause::contract_restored, D, T));
static_assert(latched_modes_never_rearm());
static_assert(faults_never_heal_into_a_stop());
static_assert(deenergising_always_wins());
}  // namespace reaction_detail

}  // namespace takt::pipeline
