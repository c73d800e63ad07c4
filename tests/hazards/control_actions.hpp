// SPDX-License-Identifier: Apache-2.0
// What may be lost, by which hazards, which constraint keeps each hazard away, and how each control action can be
// unsafe: the vocabulary of STPA (System-Theoretic Process Analysis; N. G. Leveson and J. P. Thomas, STPA Handbook,
// 2018), for a robot under Takt. Which causes of the reaction table answer them: hazard_table.hpp. docs/hazards.md is
// made of both.
//
// Control structure: a person arms, stops and disarms the executive; the policy gives it targets and gains; it commands
// drives and hears them. Nothing here knows a particular robot, tool or room.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>

namespace takt::hazards {

template <class Enum>
struct SetOf {
  std::uint64_t bits = 0;
  constexpr SetOf(std::initializer_list<Enum> members) {
    for (const Enum member : members) bits |= std::uint64_t{1} << static_cast<unsigned>(member);
  }
  [[nodiscard]] constexpr bool has(Enum member) const { return (bits >> static_cast<unsigned>(member) & 1U) != 0; }
  [[nodiscard]] constexpr bool empty() const { return bits == 0; }
};

// A test that is run where this project is tested: "program Suite.Case".
using Proof = std::string_view;
// Name of a fault in tests/mutants/faults.toml that the proof beside it notices; empty: none is written down.
using Mutant = std::string_view;

// --- losses and hazards ---

enum class Loss : std::uint8_t { person, machine, load, evidence };

inline constexpr std::array<std::string_view, 4> kLosses{"injury of a person",
                                                         "damage to the robot or its surroundings",
                                                         "the load is dropped", "no evidence of what happened"};

enum class Hazard : std::uint8_t { uncommanded, outdated, beyond, unfelt, falls, powered, unrecorded, contested };

struct HazardRow {
  Hazard hazard;
  std::string_view text;
  SetOf<Loss> losses;
  std::string_view constraint;  // the system's, that keeps the hazard away
};

inline constexpr std::array<HazardRow, 8> kHazards{{
    {Hazard::uncommanded,
     "the robot moves unarmed, or after a stop",
     {Loss::person, Loss::machine},
     "only an operator's arm leaves standby; only an operator ends a stop"},
    {Hazard::outdated,
     "the robot moves on a stale command, or one for another state or robot",
     {Loss::person, Loss::machine, Loss::load},
     "no frame carries a setpoint older than max_age by the executive's clock"},
    {Hazard::beyond,
     "the robot is commanded beyond its limits",
     {Loss::person, Loss::machine, Loss::load},
     "no frame exceeds the robot file's limits"},
    {Hazard::unfelt,
     "a joint of unknown position and speed is driven",
     {Loss::person, Loss::machine},
     "a joint silent for feedback.timeout has no power until a reset"},
    {Hazard::falls,
     "a limb or the robot sags or falls without torque",
     {Loss::person, Loss::machine, Loss::load},
     "only joints of the fault lose power; the rest is carried to rest and held"},
    {Hazard::powered,
     "drives keep their power although the operator wants none",
     {Loss::person},
     "an operator's request for no power takes one tick, in every mode and fault"},
    {Hazard::unrecorded,
     "the robot moves unrecorded",
     {Loss::evidence},
     "without its required recorder a robot does not arm, and stops"},
    {Hazard::contested,
     "another controller commands the same drives",
     {Loss::person, Loss::machine},
     "interfaces are claimed, foreign frames counted"},
}};

// --- unsafe control actions ---

enum class Action : std::uint8_t { arm, target, gains, stop, disarm };

struct ActionRow {
  Action action;
  std::string_view name, from;
  char letter;  // of its unsafe control actions' ids
};

inline constexpr std::array<ActionRow, 5> kActions{{
    {Action::arm, "arm", "an operator: `takt arm`", 'A'},
    {Action::target, "target", "the policy: positions, velocities, torques of a chunk", 'T'},
    {Action::gains, "gains", "the policy, or the robot file: stiffness and damping", 'G'},
    {Action::stop, "stop", "an operator or a cause: the damped stop, and its end by `takt reset`", 'S'},
    {Action::disarm, "disarm", "an operator or a fault: the drives lose power", 'D'},
}};

enum class Guide : std::uint8_t { not_given, given, wrong_time, wrong_length };

inline constexpr std::array<std::string_view, 4> kGuides{"not given", "given", "wrong time", "wrong length"};

// By action, counted from 1 within it.
enum class Unsafe : std::uint8_t {
  A1,
  A2,
  A3,
  A4,
  A5,
  A6,
  T1,
  T2,
  T3,
  T4,
  T5,
  T6,
  T7,
  G1,
  G2,
  G3,
  G4,
  G5,
  S1,
  S2,
  S3,
  S4,
  S5,
  S6,
  S7,
  S8,
  D1,
  D2,
  D3,
  D4,
  D5,
  D6,
  D7
};

struct UnsafeRow {
  Unsafe id;
  Action action;
  Guide guide;
  std::string_view text;
  SetOf<Hazard> hazards;
  std::string_view constraint;  // the controller's: what the executive does about it
  Proof proof;
  Mutant mutant{};
};

inline constexpr std::array<UnsafeRow, 33> kUnsafe{{
    {Unsafe::A1,
     Action::arm,
     Guide::not_given,
     "arm is refused, and the person who holds the robot releases it",
     {Hazard::falls},
     "a refusal names all that blocks arming; `takt arm` exits 0 only when arming",
     "pipeline_test Standby.ListsWhatArmingMisses",
     "a robot is armed although something blocks it"},
    {Unsafe::A2,
     Action::arm,
     Guide::given,
     "a drive, bus, feedback or recorder has failed",
     {Hazard::unfelt, Hazard::beyond, Hazard::unrecorded},
     "every condition that would stop the robot blocks arming",
     "pipeline_test BusFaults.BlockArmingInStandbyUntilTheyAreGone",
     "a robot is armed although something blocks it"},
    {Unsafe::A3,
     Action::arm,
     Guide::given,
     "a person is within reach",
     {Hazard::uncommanded},
     "it arms only on request; it detects no people",
     "pipeline_test ModeMachine.NoSetOfCausesBreaksALatch",
     "a cause is judged by the next one's row"},
    {Unsafe::A4,
     Action::arm,
     Guide::wrong_time,
     "the robot follows before all drives have power, or without usable command",
     {Hazard::outdated, Hazard::falls},
     "arming damps until every drive is enabled and a command usable",
     "pipeline_test Arming.DampsUntilAllDrivesAreEnabledAndTracksThen",
     "tracking begins before every drive is enabled"},
    {Unsafe::A5,
     Action::arm,
     Guide::wrong_length,
     "some drives do not enable",
     {Hazard::falls, Hazard::unfelt},
     "after feedback.enable_timeout it gives those up and carries the rest",
     "pipeline_test Scope.ADriveThatDoesNotEnableIsGivenUpAndTheRestIsCarried",
     "arming goes on for ever"},
    {Unsafe::A6,
     Action::arm,
     Guide::given,
     "another controller commands the drives",
     {Hazard::contested},
     "it claims the interfaces and listens first; later, foreign frames stop the robot",
     "runtime_test BusFaults.ARivalControllerShowsAsForeignFrames",
     "unknown frames are not counted"},

    {Unsafe::T1,
     Action::target,
     Guide::not_given,
     "the policy is silent",
     {Hazard::outdated, Hazard::falls},
     "it degrades, and stops after freshness.stop_after",
     "pipeline_test Freshness.PolicyDeathDegradesThenStopsWithinItsBound",
     "a policy that died degrades the robot and never stops it"},
    {Unsafe::T2,
     Action::target,
     Guide::given,
     "a target is outside the limits, or too fast",
     {Hazard::beyond},
     "the reference can always brake with the torque that gravity leaves; barriers and guard judge the rest",
     "pipeline_test Barriers.AHostileTorqueCannotDriveTheJointOutOfTheHardEnvelope",
     "the barriers let every torque through"},
    {Unsafe::T3,
     Action::target,
     Guide::given,
     "a target is NaN, misshapen, or another policy's",
     {Hazard::outdated, Hazard::beyond},
     "a message is copied once, then judged; an invalid one is never played",
     "pipeline_test Arrival.EachFaultHasItsName",
     "a message is taken twice"},
    {Unsafe::T4,
     Action::target,
     Guide::wrong_time,
     "a target is stale at the wire",
     {Hazard::outdated},
     "the clock is read before each joint's frames; a stale setpoint becomes damping",
     "runtime_test LateDeparture.AfterAStallInsideTheTickTheDrivesAreDamped",
     "a setpoint whose command died meanwhile is sent all the same"},
    {Unsafe::T5,
     Action::target,
     Guide::wrong_time,
     "targets are out of order or repeated",
     {Hazard::outdated},
     "answers to older observations and repeated sequences are refused",
     "pipeline_test Commands.AnAnswerToAnOlderObservationReplacesNoNewerOne",
     "an answer overtaken by a newer one is taken"},
    {Unsafe::T6,
     Action::target,
     Guide::wrong_length,
     "a chunk is played beyond its end",
     {Hazard::outdated},
     "each step of a chunk expires by itself",
     "pipeline_test LateSetpoint.ACommandAlsoDiesAtTheEndOfItsChunk",
     "a command lives as long as its age allows, whatever its horizon"},
    {Unsafe::T7,
     Action::target,
     Guide::given,
     "a joint that is not heard follows a target",
     {Hazard::unfelt},
     "the joint is disabled in that tick",
     "pipeline_test Scope.ALostJointOfAHostClosedLoopIsNotDriven",
     "a joint that fell silent keeps its power"},

    {Unsafe::G1,
     Action::gains,
     Guide::not_given,
     "without gains the robot would be limp",
     {Hazard::falls},
     "the robot file's gains apply",
     "pipeline_test ChunkPlayer.AbsentFieldsTakeTheJointsDefaults",
     "a policy that names no stiffness gets none"},
    {Unsafe::G2,
     Action::gains,
     Guide::given,
     "high gains make a joint oscillate or strike",
     {Hazard::beyond},
     "gains are clamped to the joint's limits, and recorded so",
     "pipeline_test Stabiliser.GainsBeyondTheirMaximumAreClampedAndSaid",
     "stiffness beyond its limit goes out"},
    {Unsafe::G3,
     Action::gains,
     Guide::given,
     "stiffness on a joint of unknown position, or on what hangs on it",
     {Hazard::unfelt},
     "what hangs on a lost joint only damps; what carries it holds",
     "pipeline_test Scope.WhatHangsOnALostJointOnlyDamps",
     "what hangs on a lost joint holds an unknown pose"},
    {Unsafe::G4,
     Action::gains,
     Guide::wrong_time,
     "full stiffness at once after arming or recovery",
     {Hazard::beyond, Hazard::uncommanded},
     "the reference starts at the joint; speed limits rise over degraded.resume_over; torque slews",
     "pipeline_test ResumeRamp.SpeedLimitsRiseFromTheScaleToAllOfThemOverItsTime",
     "tracking resumes at full speed"},
    {Unsafe::G5,
     Action::gains,
     Guide::wrong_length,
     "a stop keeps stiffness towards the last target",
     {Hazard::uncommanded, Hazard::outdated},
     "a stop damps, then holds where the robot rests",
     "pipeline_test DampedStop.ComesToRestHoldsAndWaitsForTheOperator",
     "who rests damps, where it should hold"},

    {Unsafe::S1,
     Action::stop,
     Guide::not_given,
     "a stop is not heard: busy executive, full socket, simultaneous arm",
     {Hazard::uncommanded},
     "a stop has its own socket and thread, and wins over other requests",
     "runtime_test CyclicLoop.ARequestIsReadOnceAndStopWinsOverArm",
     "a stop leaves the arm that came with it"},
    {Unsafe::S2,
     Action::stop,
     Guide::not_given,
     "executive or computer is dead",
     {Hazard::uncommanded, Hazard::powered},
     "a drive is armed only with a known command time-out or a waiver",
     "exploration_test DeadHost.NoDriveIsArmedThatNothingIsKnownToStop",
     "a drive is armed whose time-out is unknown: ODrive"},
    {Unsafe::S3,
     Action::stop,
     Guide::given,
     "a stop takes torque that carries the robot",
     {Hazard::falls},
     "with a model, a stop carries gravity, then holds; a balancing robot has its fallback",
     "pipeline_test Scope.TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds",
     "a joint that fell silent keeps its power"},
    {Unsafe::S4,
     Action::stop,
     Guide::wrong_time,
     "late ticks delay a stop",
     {Hazard::uncommanded, Hazard::outdated},
     "too many late and skipped periods stop the robot",
     "pipeline_test LatePeriods.NineOfTenTicksLateStopTheRobot",
     "the loop's work is not counted as late"},
    {Unsafe::S5,
     Action::stop,
     Guide::wrong_length,
     "a stop ends by itself when its cause does",
     {Hazard::uncommanded},
     "stops and faults latch until a reset or no power",
     "pipeline_test ModeMachine.NoSetOfCausesBreaksALatch",
     "a cause is judged by the next one's row"},
    {Unsafe::S6,
     Action::stop,
     Guide::wrong_length,
     "a reset takes power while the robot moves",
     {Hazard::falls, Hazard::uncommanded},
     "a reset needs every heard joint with power slow for 100 ms, and no fallback policy moving the robot",
     "pipeline_test Rest.AResetWaitsForWhatHangsOnALostJointToo",
     "a reset waits only for the joints that can hold"},
    {Unsafe::S7,
     Action::stop,
     Guide::given,
     "a stop pulls a joint back inside its limits",
     {Hazard::uncommanded},
     "a stop leaves the joint there",
     "pipeline_test OutsideLimits.ADampedStopLeavesItWhereItIs",
     "a stop pulls a joint back to its limits"},
    {Unsafe::S8,
     Action::stop,
     Guide::given,
     "a stop by fallback policy moves a released robot, or despite another cause",
     {Hazard::uncommanded, Hazard::falls},
     "it moves only a robot that tracked or was degraded; any other cause ends it",
     "pipeline_test StopByPolicy.APersonsNextStopMovesNobodyWhomTheFirstLetGo",
     "a stop by the fallback policy moves a robot that was released"},

    {Unsafe::D1,
     Action::disarm,
     Guide::not_given,
     "a fault, mode or bug blocks the operator's request for no power",
     {Hazard::powered},
     "de-energising outranks every cause, in every mode",
     "pipeline_test OperatorStop.DeenergisesInTheVeryTickFromEveryMode",
     "an operator's request for no power is not granted"},
    {Unsafe::D2,
     Action::disarm,
     Guide::not_given,
     "a joint that failed keeps its power",
     {Hazard::unfelt, Hazard::powered},
     "joints of a latched fault are disabled in that tick",
     "pipeline_test Scope.TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds",
     "a joint that fell silent keeps its power"},
    {Unsafe::D3,
     Action::disarm,
     Guide::given,
     "one joint's fault takes the whole robot's power",
     {Hazard::falls},
     "only joints of the fault lose power",
     "pipeline_test Scope.TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds",
     "a joint that fell silent keeps its power"},
    {Unsafe::D4,
     Action::disarm,
     Guide::given,
     "a program's repeated stop counts as a second press",
     {Hazard::falls},
     "only a press counts, 0.2 s after the first",
     "pipeline_test OperatorStop.AProgramThatRepeatsItsStopNeverTakesThePower",
     "a program's stop makes a person's first press the second"},
    {Unsafe::D5,
     Action::disarm,
     Guide::wrong_time,
     "at its end the executive takes power before rest",
     {Hazard::falls},
     "SIGTERM stops the robot and waits for rest, 10 s at most",
     "runtime_test Shutdown.Table",
     "a process ends although its robot moves"},
    {Unsafe::D6,
     Action::disarm,
     Guide::wrong_length,
     "a drive that is heard again gets power by itself",
     {Hazard::uncommanded, Hazard::unfelt},
     "it has no power until a reset",
     "pipeline_test Scope.ADriveThatIsHeardAgainStaysWithoutPowerUntilTheReset",
     "a joint without power drives again"},
    {Unsafe::D7,
     Action::disarm,
     Guide::not_given,
     "drives do not disable: dead bus, hung firmware",
     {Hazard::powered},
     "a safe-torque-off output drops before the tick's first frame",
     "pipeline_test TorqueOutput.IsPermittedFromArmingToStandby",
     "torque is permitted in standby"},
}};

namespace hazards_detail {

template <class Row, std::size_t N, class Enum>
constexpr bool in_order(const std::array<Row, N>& rows, Enum Row::*id) {
  for (std::size_t i = 0; i < N; ++i)
    if (static_cast<std::size_t>(rows.at(i).*id) != i) return false;
  return true;
}

constexpr std::size_t count_of(Action action) {
  std::size_t count = 0;
  for (const UnsafeRow& row : kUnsafe) count += row.action == action ? 1 : 0;
  return count;
}

constexpr bool is_met(Action action, Guide guide) {
  for (const UnsafeRow& row : kUnsafe)
    if (row.action == action && row.guide == guide) return true;
  return false;
}

constexpr bool every_action_is_looked_at_in_every_way() {
  for (const ActionRow& action : kActions) {
    if (count_of(action.action) < 4) return false;
    for (std::size_t guide = 0; guide < kGuides.size(); ++guide)
      if (!is_met(action.action, static_cast<Guide>(guide))) return false;
  }
  return true;
}

constexpr bool every_hazard_costs_something_and_can_come_about() {
  for (const HazardRow& hazard : kHazards) {
    bool comes_about = false;
    for (const UnsafeRow& row : kUnsafe) comes_about |= row.hazards.has(hazard.hazard);
    if (hazard.losses.empty() || hazard.constraint.empty() || !comes_about) return false;
  }
  return true;
}

constexpr bool is_proof(Proof proof) {
  const std::size_t space = proof.find(' '), dot = proof.find('.');
  return space != Proof::npos && dot != Proof::npos && space < dot && proof.find(' ', space + 1) == Proof::npos;
}

constexpr bool every_unsafe_action_is_answered() {
  for (const UnsafeRow& row : kUnsafe)
    if (row.text.empty() || row.hazards.empty() || row.constraint.empty() || !is_proof(row.proof)) return false;
  return true;
}

static_assert(in_order(kHazards, &HazardRow::hazard) && in_order(kActions, &ActionRow::action) &&
              in_order(kUnsafe, &UnsafeRow::id));
static_assert(every_action_is_looked_at_in_every_way());
static_assert(every_hazard_costs_something_and_can_come_about());
static_assert(every_unsafe_action_is_answered());

}  // namespace hazards_detail

}  // namespace takt::hazards
