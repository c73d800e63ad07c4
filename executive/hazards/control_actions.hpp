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

inline constexpr std::array<std::string_view, 4> kLosses{
    "a person is hurt", "the robot, or what stands around it, is damaged", "what the robot carries is dropped",
    "what happened, and why, cannot be told afterwards"};

enum class Hazard : std::uint8_t { uncommanded, outdated, beyond, unfelt, falls, powered, unrecorded, contested };

struct HazardRow {
  Hazard hazard;
  std::string_view text;
  SetOf<Loss> losses;
  std::string_view constraint;  // the system's, that keeps the hazard away
};

inline constexpr std::array<HazardRow, 8> kHazards{{
    {Hazard::uncommanded,
     "the robot moves although it was not armed, or after it was told to stop",
     {Loss::person, Loss::machine},
     "only a person's arm, granted while nothing blocks it, leaves standby; every stop stays until a person ends it"},
    {Hazard::outdated,
     "the robot moves on a command that is too old, or meant for another state or another robot",
     {Loss::person, Loss::machine, Loss::load},
     "no frame carries a setpoint of a command older than max_age, by the executive's own clock and memory"},
    {Hazard::beyond,
     "the robot is asked for more than its limits on position, speed, torque, slew or gains allow",
     {Loss::person, Loss::machine, Loss::load},
     "no frame asks for more than the robot file allows, whatever the policy or our own code says"},
    {Hazard::unfelt,
     "a joint is driven whose position and speed are unknown",
     {Loss::person, Loss::machine},
     "a joint that was silent for feedback.timeout is not driven, and gets no power again before a person's reset"},
    {Hazard::falls,
     "a limb, or the whole robot, sags or falls because torque that carried it is gone",
     {Loss::person, Loss::machine, Loss::load},
     "power leaves no more joints than the fault is about; the rest is carried, brought to rest and held"},
    {Hazard::powered,
     "drives keep their power although a person wants none",
     {Loss::person},
     "an operator's request for no power is carried out in one tick, from every mode, with every fault"},
    {Hazard::unrecorded,
     "the robot moves and nothing of it is recorded",
     {Loss::evidence},
     "a robot whose recorder is required neither arms nor goes on moving without it"},
    {Hazard::contested,
     "another controller commands the same drives",
     {Loss::person, Loss::machine},
     "one controller per bus: interfaces are claimed, ids are listened to before the first frame and ever after"},
}};

// --- unsafe control actions ---

enum class Action : std::uint8_t { arm, target, gains, stop, disarm };

struct ActionRow {
  Action action;
  std::string_view name, from;
  char letter;  // of its unsafe control actions' ids
};

inline constexpr std::array<ActionRow, 5> kActions{{
    {Action::arm, "arm", "a person: `takt arm`", 'A'},
    {Action::target, "target", "the policy: positions, velocities, torques of a chunk", 'T'},
    {Action::gains, "gains", "the policy, or the robot file: stiffness and damping", 'G'},
    {Action::stop, "stop", "a person, or a cause: the damped stop, and its end by `takt reset`", 'S'},
    {Action::disarm, "disarm", "a person, or a fault: the drives' power is taken", 'D'},
}};

enum class Guide : std::uint8_t { not_given, given, wrong_time, wrong_length };

inline constexpr std::array<std::string_view, 4> kGuides{
    "not given", "given where it is unsafe", "too early, too late, out of order", "ended too soon, lasts too long"};

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
     "arm is asked for and refused, and the person who holds the robot lets go of it",
     {Hazard::falls},
     "a refusal names everything that blocks arming; `takt arm` ends well only when the robot is being armed",
     "pipeline_test Standby.ListsWhatArmingMisses",
     "a robot is armed although something blocks it"},
    {Unsafe::A2,
     Action::arm,
     Guide::given,
     "arm is given while a drive, a bus, a joint's feedback or the recorder is not fit",
     {Hazard::unfelt, Hazard::beyond, Hazard::unrecorded},
     "every condition that would stop the robot blocks arming",
     "pipeline_test BusFaults.BlockArmingInStandbyUntilTheyAreGone",
     "a robot is armed although something blocks it"},
    {Unsafe::A3,
     Action::arm,
     Guide::given,
     "arm is given while a person is within reach",
     {Hazard::uncommanded},
     "the executive sees no people: what it can do is to arm on a person's request only, never by itself",
     "pipeline_test ModeMachine.NoSetOfCausesBreaksALatch",
     "a cause is judged by the next one's row"},
    {Unsafe::A4,
     Action::arm,
     Guide::wrong_time,
     "the robot begins to follow before all drives have power or before a command is usable",
     {Hazard::outdated, Hazard::falls},
     "arming damps and waits until every drive is enabled and a fresh command is there",
     "pipeline_test Arming.DampsUntilAllDrivesAreEnabledAndTracksThen",
     "tracking begins before every drive is enabled"},
    {Unsafe::A5,
     Action::arm,
     Guide::wrong_length,
     "arming goes on, half of the drives with power, half without",
     {Hazard::falls, Hazard::unfelt},
     "after feedback.enable_timeout the drives that did not enable are given up, the rest is carried",
     "pipeline_test Scope.ADriveThatDoesNotEnableIsGivenUpAndTheRestIsCarried",
     "arming goes on for ever"},
    {Unsafe::A6,
     Action::arm,
     Guide::given,
     "arm is given while another controller commands the drives",
     {Hazard::contested},
     "before its first frame the executive claims the interfaces and listens; later, foreign frames stop the robot",
     "runtime_test BusFaults.ARivalControllerShowsAsForeignFrames",
     "unknown frames are not counted"},

    {Unsafe::T1,
     Action::target,
     Guide::not_given,
     "the policy gives no target any more",
     {Hazard::outdated, Hazard::falls},
     "the robot holds, slows or falls back once the policy is late, and stops after freshness.stop_after",
     "pipeline_test Freshness.PolicyDeathDegradesThenStopsWithinItsBound",
     "a policy that died degrades the robot and never stops it"},
    {Unsafe::T2,
     Action::target,
     Guide::given,
     "a target lies outside the limits, or leads there too fast",
     {Hazard::beyond},
     "the reference never leaves the set from which it can brake, with what torque gravity leaves; the torque barriers "
     "and "
     "the guard judge what is left",
     "pipeline_test Barriers.AHostileTorqueCannotDriveTheJointOutOfTheHardEnvelope",
     "the barriers let every torque through"},
    {Unsafe::T3,
     Action::target,
     Guide::given,
     "a target is NaN, has the wrong shape, or is another policy's",
     {Hazard::outdated, Hazard::beyond},
     "a message is copied once, then judged whole; what is wrong is refused by name and never played",
     "pipeline_test Arrival.EachFaultHasItsName",
     "a message is taken twice"},
    {Unsafe::T4,
     Action::target,
     Guide::wrong_time,
     "a target reaches the wire after it became too old",
     {Hazard::outdated},
     "the clock is read again before each joint's frames; a setpoint that is too late stays behind, the drive damps",
     "runtime_test LateDeparture.AfterAStallInsideTheTickTheDrivesAreDamped",
     "a setpoint whose command died meanwhile is sent all the same"},
    {Unsafe::T5,
     Action::target,
     Guide::wrong_time,
     "targets come out of order, or an old one comes again",
     {Hazard::outdated},
     "an answer to an older observation than the one in use is refused, and so is a repeated sequence",
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
     "a target is followed by a joint that is not heard",
     {Hazard::unfelt},
     "such a joint is disabled from that tick on",
     "pipeline_test Scope.ALostJointOfAHostClosedLoopIsNotDriven",
     "a joint that fell silent keeps its power"},

    {Unsafe::G1,
     Action::gains,
     Guide::not_given,
     "the policy gives no gains, and the robot would be limp",
     {Hazard::falls},
     "what the policy leaves out is the robot file's",
     "pipeline_test ChunkPlayer.AbsentFieldsTakeTheJointsDefaults",
     "a policy that names no stiffness gets none"},
    {Unsafe::G2,
     Action::gains,
     Guide::given,
     "gains are so high that a joint oscillates or strikes hard",
     {Hazard::beyond},
     "gains are clamped to the joint's limits, and the record says so",
     "pipeline_test Stabiliser.GainsBeyondTheirMaximumAreClampedAndSaid",
     "stiffness beyond its limit goes out"},
    {Unsafe::G3,
     Action::gains,
     Guide::given,
     "stiffness is given to a joint whose position is not known, or that hangs on one",
     {Hazard::unfelt},
     "what hangs on a lost joint gets damping only; what carries it is stiff about its own heard position",
     "pipeline_test Scope.WhatHangsOnALostJointOnlyDamps",
     "what hangs on a lost joint holds an unknown pose"},
    {Unsafe::G4,
     Action::gains,
     Guide::wrong_time,
     "full stiffness comes at once, as arming or recovery begins",
     {Hazard::beyond, Hazard::uncommanded},
     "the reference starts where the joint is; speed limits rise over degraded.resume_over; torque slews",
     "pipeline_test ResumeRamp.SpeedLimitsRiseFromTheScaleToAllOfThemOverItsTime",
     "tracking resumes at full speed"},
    {Unsafe::G5,
     Action::gains,
     Guide::wrong_length,
     "stiffness towards the last target is kept on in a stop",
     {Hazard::uncommanded, Hazard::outdated},
     "a stop damps without stiffness, and holds only once the robot rests, where it rests",
     "pipeline_test DampedStop.ComesToRestHoldsAndWaitsForTheOperator",
     "who rests damps, where it should hold"},

    {Unsafe::S1,
     Action::stop,
     Guide::not_given,
     "a person's stop is not heard: the executive is busy, its socket is full, an arm came with it",
     {Hazard::uncommanded},
     "a stop has a socket and a thread of its own, sets a flag, and wins over every other request of its tick",
     "runtime_test CyclicLoop.ARequestIsReadOnceAndStopWinsOverArm",
     "a stop leaves the arm that came with it"},
    {Unsafe::S2,
     Action::stop,
     Guide::not_given,
     "the executive or its computer is dead, and nothing stops the robot",
     {Hazard::uncommanded, Hazard::powered},
     "a drive is armed only if its time-out on missing commands is known, or the robot file waives it with a reason",
     "exploration_test DeadHost.NoDriveIsArmedThatNothingIsKnownToStop",
     "a drive is armed whose time-out is unknown: ODrive"},
    {Unsafe::S3,
     Action::stop,
     Guide::given,
     "a stop takes the torque that carries the robot",
     {Hazard::falls},
     "a stop carries gravity until the robot rests and then holds, where a model is given; a robot that has to balance "
     "has its fallback",
     "pipeline_test Scope.TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds",
     "a joint that fell silent keeps its power"},
    {Unsafe::S4,
     Action::stop,
     Guide::wrong_time,
     "a stop is late, because ticks are",
     {Hazard::uncommanded, Hazard::outdated},
     "late and skipped periods are counted, and too many of them are a stop by themselves",
     "pipeline_test LatePeriods.NineOfTenTicksLateStopTheRobot",
     "the loop's work is not counted as late"},
    {Unsafe::S5,
     Action::stop,
     Guide::wrong_length,
     "a stop ends by itself when its cause does",
     {Hazard::uncommanded},
     "stops and faults latch; only a person's reset or de-energising leaves them",
     "pipeline_test ModeMachine.NoSetOfCausesBreaksALatch",
     "a cause is judged by the next one's row"},
    {Unsafe::S6,
     Action::stop,
     Guide::wrong_length,
     "a reset ends a stop while the robot still moves, and takes its power",
     {Hazard::falls, Hazard::uncommanded},
     "a reset is granted once every joint that is heard and has power has been slow for 100 ms, what sags included, "
     "and not while a fallback policy moves the robot",
     "pipeline_test Rest.AResetWaitsForWhatHangsOnALostJointToo",
     "a reset waits only for the joints that can hold"},
    {Unsafe::S7,
     Action::stop,
     Guide::given,
     "a stop pulls a joint that stands outside its limits back inside",
     {Hazard::uncommanded},
     "a stop leaves such a joint where it is",
     "pipeline_test OutsideLimits.ADampedStopLeavesItWhereItIs",
     "a stop pulls a joint back to its limits"},
    {Unsafe::S8,
     Action::stop,
     Guide::given,
     "a stop that is left to the fallback policy moves a robot that was released, or that something else stops too",
     {Hazard::uncommanded, Hazard::falls},
     "that policy only goes on moving a robot that tracked or was degraded; any other cause ends it for good",
     "pipeline_test StopByPolicy.APersonsNextStopMovesNobodyWhomTheFirstLetGo",
     "a stop by the fallback policy moves a robot that was released"},

    {Unsafe::D1,
     Action::disarm,
     Guide::not_given,
     "a person wants no power, and a fault, a mode or a bug of ours is in the way",
     {Hazard::powered},
     "de-energising outranks every cause, in every mode",
     "pipeline_test OperatorStop.DeenergisesInTheVeryTickFromEveryMode",
     "an operator's request for no power is not granted"},
    {Unsafe::D2,
     Action::disarm,
     Guide::not_given,
     "a joint that failed keeps its power",
     {Hazard::unfelt, Hazard::powered},
     "the joints that a latched fault is about are disabled in that tick",
     "pipeline_test Scope.TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds",
     "a joint that fell silent keeps its power"},
    {Unsafe::D3,
     Action::disarm,
     Guide::given,
     "one joint's fault takes the power of the whole robot, which falls",
     {Hazard::falls},
     "power leaves the joints that the fault is about and no others",
     "pipeline_test Scope.TheJointLosesPowerWhatHangsOnItDampsTheRestIsCarriedAndHolds",
     "a joint that fell silent keeps its power"},
    {Unsafe::D4,
     Action::disarm,
     Guide::given,
     "a program that repeats its stop is taken for a person's second press",
     {Hazard::falls},
     "only presses count as presses, and only 0.2 s after the first",
     "pipeline_test OperatorStop.AProgramThatRepeatsItsStopNeverTakesThePower",
     "a program's stop makes a person's first press the second"},
    {Unsafe::D5,
     Action::disarm,
     Guide::wrong_time,
     "power goes before the robot rests, when the executive is told to end",
     {Hazard::falls},
     "SIGTERM stops the robot first and waits until it rests, 10 s at most",
     "runtime_test Shutdown.Table",
     "a process ends although its robot moves"},
    {Unsafe::D6,
     Action::disarm,
     Guide::wrong_length,
     "a drive that is heard again gets its power back by itself",
     {Hazard::uncommanded, Hazard::unfelt},
     "it stays without power until a person's reset",
     "pipeline_test Scope.ADriveThatIsHeardAgainStaysWithoutPowerUntilTheReset",
     "a joint without power drives again"},
    {Unsafe::D7,
     Action::disarm,
     Guide::not_given,
     "drives are told to disable and do not: their bus is dead, their firmware hangs",
     {Hazard::powered},
     "where the robot file names an output into safe torque off, it drops before the first frame of the same tick",
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
