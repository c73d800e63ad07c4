// SPDX-License-Identifier: Apache-2.0
// One row for every cause of the reaction table (pipeline/mode_machine.hpp): which hazards it answers, how they come
// about, how the cause is found, the tests that prove the reaction, what risk stays, and which device outside of this
// computer has to cover it. Modes, stop categories, bounds and what clears a cause are not repeated here: they are the
// reaction table's.
//
// It claims no conformance to any standard. It says what this software does and does not do, for whoever assesses a
// robot. The compiler refuses a cause without a row and a row that is incomplete; a test runs every proof named here
// (tests/exploration/hazards_test.py) and holds docs/hazards.md to this table and to the times that are measured.
#pragma once

#include "executive/hazards/control_actions.hpp"
#include "executive/pipeline/mode_machine.hpp"

namespace takt::hazards {

// What has to stand beside the computer, for what no software on it can do.
enum class Device : std::uint8_t { emergency_stop, brakes, end_stops, fence, gantry, drive_timeout };

inline constexpr std::array<std::string_view, 6> kDevices{
    "an emergency stop that takes the torque past this computer (safe torque off)",
    "brakes that close without power, on every joint that carries weight",
    "mechanical end stops that bear the joint's full speed and torque",
    "a fence or a distance that keeps people out of reach while the robot is armed",
    "for robots that stand or balance: a gantry that catches them, and a person who watches it",
    "each drive's own time-out, set and tested with the cable pulled"};

struct Row {
  Cause cause;
  SetOf<Hazard> hazards;
  SetOf<Unsafe> unsafe;       // the control actions that it answers
  std::string_view scenario;  // how it comes about
  std::string_view found;     // how
  std::array<Proof, 2> proofs;
  std::string_view residual;
  SetOf<Device> devices;
  Mutant mutant{};  // that one of the proofs notices
};

// By cause, without Cause::none, which is no reaction.
inline constexpr std::array<Row, kCauseCount - 1> kRows{{
    {Cause::operator_arm,
     {Hazard::uncommanded},
     {Unsafe::A1, Unsafe::A2, Unsafe::A3, Unsafe::A6},
     "a person arms a robot that is not fit, or beside which another stands",
     "a request, judged against every condition that would stop the robot",
     {"pipeline_test Standby.ListsWhatArmingMisses", "pipeline_test Standby.ADriveThatIsStillOnBlocksArming"},
     "nothing here sees people, tools or obstacles: the person who arms has to look",
     {Device::emergency_stop, Device::fence, Device::gantry},
     "a robot is armed although something blocks it"},
    {Cause::operator_stop,
     {Hazard::uncommanded, Hazard::falls},
     {Unsafe::S1, Unsafe::S3, Unsafe::S8},
     "the robot does what is not wanted, and a person stops it",
     "a flag that the stop's own thread sets, read by the next tick",
     {"pipeline_test OperatorStop.TheSecondPressTakesThePowerAway",
      "runtime_test CyclicLoop.StopsAreReadInTheOrderOfTheirWeight"},
     "a terminal, a network and a kernel lie between the person and the flag: this stop is no emergency stop",
     {Device::emergency_stop, Device::gantry},
     "a second stop takes no power away"},
    {Cause::operator_reset,
     {Hazard::falls, Hazard::uncommanded},
     {Unsafe::S5, Unsafe::S6, Unsafe::D6},
     "a person ends a stop while the robot moves, or while what stopped it is still there",
     "a request, granted at rest and when no lasting fault holds",
     {"pipeline_test Rest.ALatchedFaultIsResetAtRestOnly", "pipeline_test Faults.ResetWaitsUntilTheConditionIsGone"},
     "reset takes the drives' power: what hangs on a joint without a brake falls, and the speed of a "
     "silent joint is unknown",
     {Device::brakes, Device::gantry},
     "a reset is granted while the fault lasts"},
    {Cause::shutdown,
     {Hazard::falls, Hazard::uncommanded},
     {Unsafe::D5},
     "the service is ended, or the computer is shut down, while the robot moves",
     "SIGTERM or SIGINT, read by the next tick",
     {"pipeline_test Shutdown.StopsAnArmedRobotAndLeavesStandbyAlone", "runtime_test Shutdown.Table"},
     "power goes at the end, after 10 s even if the robot still moves; a second signal does not wait at all",
     {Device::brakes, Device::gantry},
     "a shutdown is not granted"},
    {Cause::drives_enabled,
     {Hazard::outdated, Hazard::falls},
     {Unsafe::A4, Unsafe::G4},
     "the robot begins to follow the policy",
     "every drive says that it is enabled, and a command is usable",
     {"pipeline_test Arming.DampsUntilAllDrivesAreEnabledAndTracksThen",
      "pipeline_test ResumeRamp.AlsoBeginsWithArmingAndWithNothingElse"},
     "a drive that says it is enabled and is not leaves its joint limp until the robot is seen to sag",
     {Device::emergency_stop, Device::gantry},
     "tracking begins before every drive is enabled"},
    {Cause::enable_timeout,
     {Hazard::falls, Hazard::unfelt},
     {Unsafe::A5},
     "a drive does not enable: no supply, a setting, a fault that it does not tell",
     "armed for longer than feedback.enable_timeout, and not every drive is enabled",
     {"pipeline_test Arming.GivesUpOnADriveThatDoesNotEnable",
      "pipeline_test Scope.ADriveThatDoesNotEnableIsGivenUpAndTheRestIsCarried"},
     "what hangs on the joints that did not enable is not carried",
     {Device::brakes, Device::gantry},
     "arming goes on for ever"},
    {Cause::contract_violated,
     {Hazard::outdated},
     {Unsafe::T1, Unsafe::T4, Unsafe::T6},
     "the policy is late more often than the task can bear: load, a slow network, a stall",
     "evidence that more than epsilon of the ticks have no usable command: eleven times the longest silence beyond it",
     {"pipeline_test Freshness.LateAgainAndAgainViolatesTheContract",
      "pipeline_test Degraded.HoldBrakesToRestAndIgnoresThePolicy"},
     "until then short silences are met one by one; max_age is the robot file's word (`takt margin` measures it)",
     {Device::fence, Device::gantry},
     "misses beyond epsilon violate nothing"},
    {Cause::contract_restored,
     {Hazard::outdated, Hazard::beyond},
     {Unsafe::G4},
     "the policy is back, and its target has moved on",
     "fresh without interruption for freshness.recover_after, longer after flapping",
     {"pipeline_test Recovery.FlappingDoublesTheWaitUpToSixteenTimes",
      "pipeline_test ResumeRamp.SpeedLimitsRiseFromTheScaleToAllOfThemOverItsTime"},
     "the robot starts to move again by itself, for degraded.resume_over at a limited speed",
     {Device::fence},
     "a relapse lengthens no wait"},
    {Cause::command_lost,
     {Hazard::outdated, Hazard::falls},
     {Unsafe::T1, Unsafe::T6},
     "the policy host died, hangs, or was never there",
     "no usable command for freshness.stop_after",
     {"pipeline_test Recovery.ACommandIsLostExactlyAfterStopAfter",
      "pipeline_test Freshness.PolicyDeathDegradesThenStopsWithinItsBound"},
     "a robot that has to be balanced falls unless its fallback balances it: a stop is no safe state for it",
     {Device::gantry, Device::emergency_stop},
     "a policy that died degrades the robot and never stops it"},
    {Cause::bad_commands,
     {Hazard::outdated, Hazard::beyond},
     {Unsafe::T3, Unsafe::T5},
     "a wrong, broken or hostile policy sends what is refused for what it says",
     "more than freshness.bad_command_limit refusals in the window",
     {"pipeline_test Commands.RepeatedRefusalsStopTheRobot", "pipeline_test Commands.LateOnesAreNoIntegrationError"},
     "a command that is well-formed, fresh and wrong is obeyed within the limits",
     {Device::emergency_stop, Device::fence},
     "refused messages stop nothing"},
    {Cause::feedback_lost,
     {Hazard::unfelt, Hazard::falls},
     {Unsafe::T7, Unsafe::D2, Unsafe::D3, Unsafe::G3},
     "a cable, connector or drive fails, or the computer was suspended",
     "a joint's newest reply is older than feedback.timeout, by its receive stamp",
     {"pipeline_test Faults.EachLeadsToItsMode", "simulated_drives_test LostDrive.IsNeverDrivenByItsLastReading"},
     "the joint coasts or falls, unless it has a brake; a drive that cannot hear us either goes on until its own "
     "time-out",
     {Device::brakes, Device::drive_timeout, Device::emergency_stop, Device::gantry},
     "torque goes on by the last reading of a joint that fell silent"},
    {Cause::drive_fault,
     {Hazard::falls, Hazard::unfelt},
     {Unsafe::D2, Unsafe::D3},
     "a drive finds an error: temperature, current, encoder, supply",
     "the drive's own word, in a reply or a report",
     {"pipeline_test Faults.EachLeadsToItsMode",
      "simulated_drives_test DriveLoopTest.AFaultReachesTheHostAndDisablingClearsIt"},
     "an error that the drive does not see itself, a slipped encoder say, is in no row; its joint coasts or falls",
     {Device::brakes, Device::end_stops, Device::gantry},
     "a drive's error is no fault"},
    {Cause::drive_disabled,
     {Hazard::falls, Hazard::contested},
     {Unsafe::D3, Unsafe::D6, Unsafe::A6},
     "a drive loses its supply, restarts, or is switched off by another controller",
     "the drive says that it is disabled, and we did not disable it",
     {"pipeline_test Faults.EachLeadsToItsMode",
      "pipeline_test Scope.ADriveThatIsHeardAgainStaysWithoutPowerUntilTheReset"},
     "the joint coasts or falls before it can be known",
     {Device::brakes, Device::gantry},
     "a drive that switched itself off is not noticed"},
    {Cause::bus_off,
     {Hazard::unfelt, Hazard::falls},
     {Unsafe::T7, Unsafe::D2, Unsafe::D3},
     "wiring, termination or a broken node drives the CAN controller off the bus",
     "the controller's own state",
     {"pipeline_test Faults.EachLeadsToItsMode", "runtime_test BusFaults.EachReachesTheTickAsItsCauseAlone"},
     "nothing reaches the drives of that bus, disable included: they go on until their own time-outs",
     {Device::drive_timeout, Device::emergency_stop, Device::brakes, Device::gantry},
     "a bus that is off is not noticed"},
    {Cause::bus_down,
     {Hazard::unfelt, Hazard::falls},
     {Unsafe::T7, Unsafe::D2, Unsafe::D3},
     "an adapter is pulled out, or its interface is set down",
     "a write fails, or the interface is gone",
     {"pipeline_test Faults.EachLeadsToItsMode",
      "runtime_test BusFaults.ALinkThatGoesDownIsNamedAtOnceAndForgottenWhenItIsUpAgain"},
     "nothing reaches the drives of that bus, disable included: they go on until their own time-outs",
     {Device::drive_timeout, Device::emergency_stop, Device::brakes, Device::gantry},
     "an interface that is down is not noticed"},
    {Cause::bus_error_passive,
     {Hazard::unfelt},
     {Unsafe::T4},
     "wiring or termination is near to failing",
     "the controller is error-passive for more than bus_faults.error_passive of the window",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed",
      "pipeline_test Buses.EachFaultIsFoundAboveItsShareAndHeals"},
     "single frames are lost meanwhile; if the bus fails within the window, bus_off or feedback_lost takes over",
     {Device::drive_timeout},
     "a controller's warnings are not counted"},
    {Cause::transmit_queue_full,
     {Hazard::outdated},
     {Unsafe::T4, Unsafe::D2},
     "the bus is crowded, or no node acknowledges: our frames do not get out",
     "frames refused or given up in more than bus_faults.transmit_drops of the ticks",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed",
      "runtime_test BusFaults.EachReachesTheTickAsItsCauseAlone"},
     "a drive acts on its last frame until the next one reaches it, or its own time-out ends it",
     {Device::drive_timeout, Device::emergency_stop},
     "frames that do not get out are not counted"},
    {Cause::receive_overflow,
     {Hazard::unfelt},
     {Unsafe::T7},
     "this computer does not read its buses in time",
     "frames dropped by socket or controller in more than bus_faults.receive_drops of the ticks",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed",
      "runtime_test BusFaults.EachReachesTheTickAsItsCauseAlone"},
     "a drive's error report may be among what was lost; the next reply repeats its state",
     {Device::drive_timeout},
     "frames lost on receive are not counted"},
    {Cause::replies_lost,
     {Hazard::unfelt},
     {Unsafe::T7},
     "frames vanish between drive and computer, too few at a time for silence",
     "more than bus_faults.replies_lost of the replies a joint owes never come",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed",
      "pipeline_test Replies.MoreThanTheShareLostIsAFaultUntilItHeals"},
     "below that share the joint is driven by feedback that is some periods old, at most feedback.timeout",
     {Device::end_stops},
     "lost replies are no cause"},
    {Cause::replies_repeated,
     {Hazard::contested, Hazard::unfelt},
     {Unsafe::A6},
     "two drives have one id, or a frame comes twice",
     "replies beyond those owed in more than bus_faults.replies_repeated of the ticks",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed", "pipeline_test Replies.TwoDrivesOnOneIdAreRepetition"},
     "until then two joints obey one joint's setpoints",
     {Device::end_stops, Device::emergency_stop},
     "repeated replies are no cause"},
    {Cause::replies_delayed,
     {Hazard::unfelt},
     {Unsafe::T7},
     "an adapter or a driver hands replies over in bunches",
     "replies more than two ticks late in more than bus_faults.replies_delayed of what a joint owes",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed", "pipeline_test Replies.BunchesAreDelayAndNothingElse"},
     "until then control has less phase margin than it was tuned for",
     {Device::end_stops},
     "delayed replies are no cause"},
    {Cause::foreign_node,
     {Hazard::contested},
     {Unsafe::A6},
     "a second controller commands our drives, or a node answers with nonsense",
     "frames on our ids that are none of ours in more than bus_faults.foreign_frames of the ticks",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed",
      "runtime_test BusFaults.ARivalControllerShowsAsForeignFrames"},
     "until then, and after it, drives obey the controller that writes last: a stop of ours does not silence the other",
     {Device::emergency_stop, Device::fence},
     "strange frames are not counted"},
    {Cause::bus_babble,
     {Hazard::contested, Hazard::unfelt},
     {Unsafe::A6, Unsafe::T4},
     "a node sends without end",
     "more frames in a tick than our drives can say, in more than bus_faults.babble of the ticks",
     {"pipeline_test BusFaults.StopTheRobotDampedAndAreNamed",
      "runtime_test BusFaults.FloodedIsMoreThanOurDrivesCanSay"},
     "frames with lower ids win the bus: ours may not get out",
     {Device::drive_timeout, Device::emergency_stop},
     "a flood is not counted"},
    {Cause::envelope_exceeded,
     {Hazard::beyond},
     {Unsafe::T2, Unsafe::G2, Unsafe::S7},
     "a joint is thrown, pushed or slips beyond limits.position and its margin, or velocity_hard",
     "measured position, estimated velocity",
     {"pipeline_test Faults.EachLeadsToItsMode",
      "pipeline_test OutsideLimits.BeyondTheMarginAStopDampsAndDoesNotFetchIt"},
     "the joint is out there already, and only damping, friction and the end stop take its energy",
     {Device::end_stops, Device::fence},
     "a joint outside its hard envelope is not noticed"},
    {Cause::overrun,
     {Hazard::outdated, Hazard::uncommanded},
     {Unsafe::S4, Unsafe::T4},
     "the computer is overloaded, or its kernel stalls",
     "periods late or skipped: more than control.late_share of the window",
     {"pipeline_test LatePeriods.NineOfTenTicksLateStopTheRobot",
      "runtime_test CyclicLoop.AnOverrunSkipsPeriodsKeepsPhaseAndIsCountedOnce"},
     "while the computer stands still nothing here reacts: drives go on with their last frame until their own "
     "time-outs",
     {Device::drive_timeout, Device::emergency_stop},
     "the loop's work is not counted as late"},
    {Cause::recording_lost,
     {Hazard::unrecorded},
     {Unsafe::A2},
     "the monitor dies, falls behind, or its disk takes no more",
     "the recorder's own word on what reached its medium: none, or half of the record ring behind",
     {"pipeline_test Recording.ARobotThatMovesStopsWhenItsRecorderEnds",
      "pipeline_test Recording.ARecorderMayBeBehindByTheLimitAndNoMore"},
     "a power cut loses the last second; with record.recorder: optional this cause never holds",
     {Device::emergency_stop},
     "a robot moves on while its recorder is behind"},
    {Cause::internal_error,
     {Hazard::beyond, Hazard::outdated},
     {Unsafe::T2, Unsafe::T3, Unsafe::G2},
     "our own code is wrong: a result that is NaN, a frame that is not what was decided",
     "assertions, the final clamp, and a guard that reads every frame back before it leaves",
     {"pipeline_test RefusedFrame.EveryVerdictThatIsABugLatchesTheFault",
      "pipeline_test InternalError.ResultsThatAreNotFiniteNeverLeave"},
     "a bug that stays inside every limit is not seen; without a model the robot sags",
     {Device::emergency_stop, Device::fence, Device::gantry},
     "a frame that the guard refused is no fault"},
    {Cause::operator_deenergise,
     {Hazard::powered},
     {Unsafe::D1, Unsafe::D4, Unsafe::D7},
     "a person wants no power, now",
     "`takt stop --now`, or a second press 0.2 s or more after the first",
     {"pipeline_test OperatorStop.DeenergisesInTheVeryTickFromEveryMode",
      "pipeline_test OperatorStop.WinsOverOurOwnBug"},
     "what hangs falls; drives whose bus is dead do not hear it; it is software, and no emergency stop",
     {Device::emergency_stop, Device::brakes, Device::gantry},
     "an operator's request for no power is not granted"},
    {Cause::torque_output_lost,
     {Hazard::powered},
     {Unsafe::D7},
     "the line of the output that permits torque cannot be set, or another device pulls it",
     "it is set where it changes, and read back in every tick",
     {"pipeline_test TorqueOutput.OneThatFailsStopsTheRobotAndNobodyArms",
      "runtime_test TorqueOutput.ItIsToldBeforeTheFirstFrameOfATick"},
     "its level is not known: torque may be gone already, or may stay whatever is told; the output is one channel, and "
     "reads its own register, not the drives' inputs",
     {Device::emergency_stop, Device::brakes, Device::gantry},
     "an output that does otherwise is not noticed"},
    {Cause::tilt,
     {Hazard::falls, Hazard::beyond},
     {Unsafe::T2, Unsafe::S7},
     "the base is pushed, slips or stumbles, or the policy throws it over",
     "the angle of the base's z axis from upright beyond imu.tilt, or its rate beyond imu.angular_velocity",
     {"pipeline_test ImuCauses.ABaseThatLeansOrTurnsTooFarStopsTheRobot",
      "incident_test ImuIncident.SaysHowFarTheBaseLeans"},
     "a robot that leans that far falls: a damped stop only softens it",
     {Device::gantry, Device::fence},
     "a base that leans is not noticed"},
    {Cause::imu_lost,
     {Hazard::unfelt, Hazard::falls},
     {Unsafe::T7},
     "the IMU's cable, its process or its clock fails, or it says the same again and again",
     "no usable sample sensed within the sensor's timeout; samples that lie (future, backwards, NaN, no unit "
     "quaternion) are not used; imu.frozen_after; imu.contradiction",
     {"pipeline_test ImuCauses.EachWayToLoseItStopsTheRobot", "imu_link_test ImuLinkTest.ASensorThatIsKilledIsLost"},
     "one that drifts, or is mounted otherwise than the model says, is believed; a robot that balances falls without "
     "it",
     {Device::gantry, Device::fence},
     "an IMU that fell silent is believed for ever"},
    {Cause::fallback_spent,
     {Hazard::falls, Hazard::outdated},
     {Unsafe::S2},
     "the policy does not come back, and the fallback policy has moved the robot for as long as it may, or talks "
     "nonsense",
     "time since it took over beyond fallbacks.NAME.for; its targets out of range in more than freshness.clamped_share "
     "of the window",
     {"pipeline_test FallbackPolicy.MayPlayForSoLongAndNoLonger",
      "pipeline_test StopByPolicy.ItsOwnNonsenseEndsItHoweverItWasStopped"},
     "a robot that stands by its policies alone falls when it stops; with `for: 0 s` a robot plays on unasked",
     {Device::gantry, Device::fence},
     "the fallback policy may answer out of range without end"},
    {Cause::temperature_high,
     {Hazard::falls},
     {Unsafe::T2},
     "a drive works harder than it can cool, and will switch itself off if it goes on",
     "the drive's own temperatures beyond limits.temperature.warning or casing_warning",
     {"pipeline_test Temperatures.AWarningIsToldAndDegradesWhereTheRobotFileSaysSo",
      "pipeline_test Temperatures.DegradedByHeatItStaysSoUntilItIsCooler"},
     "a robot that is only told works on; the drive measures where its sensor sits",
     {Device::gantry},
     "a robot that heat degraded is restored while it is hot"},
    {Cause::overtemperature,
     {Hazard::falls, Hazard::beyond},
     {Unsafe::T2},
     "a drive is about to burn, or to switch itself off under load",
     "the drive's own temperatures beyond limits.temperature.stop or casing_stop",
     {"pipeline_test Temperatures.BeyondTheLimitTheRobotStopsAndArmsNoMoreUntilItIsCooler",
      "pipeline_test Temperatures.ADriveThatTellsNoneIsNotArmedUnderALimit"},
     "holding still takes torque and heats on; the drive measures where its sensor sits",
     {Device::gantry, Device::brakes},
     "a hot casing stops nothing"},
    {Cause::degraded_spent,
     {Hazard::falls, Hazard::outdated},
     {Unsafe::S2},
     "the policy comes and goes for so long that the contract is never restored",
     "time since the robot was degraded beyond degraded.for",
     {"pipeline_test DegradedFor.EndsInAStopWhateverTheBehaviour",
      "incident_test DegradedIncident.SaysThatItsTimeIsOver"},
     "a robot that stands by its policies alone falls when it stops; with `for: 0 s` it stays degraded without end",
     {Device::gantry, Device::fence},
     "a robot stays degraded for as long as it likes"},
    {Cause::feedback_implausible,
     {Hazard::unfelt, Hazard::falls, Hazard::beyond},
     {Unsafe::T7, Unsafe::D2, Unsafe::D3, Unsafe::G3},
     "an encoder slips, freezes or wraps, a drive repeats an old reply, or sign and scale of a joint are wrong",
     "positions out of reach (feedback.jump), against the drive's own velocity (feedback.contradiction), or still "
     "while "
     "velocity or torque says that the joint moves (feedback.frozen_after)",
     {"simulated_drives_test WrongFeedback.FrozenIsFoundBeforeTheJointGetsFar",
      "simulated_drives_test WrongFeedback.AJumpMovesNothing"},
     "a jump within feedback.jump is followed; an encoder that stands still with its velocity, on a drive that closes "
     "its own loop, looks like a joint that is held; a scale that is wrong by less than a quarter is not found",
     {Device::brakes, Device::emergency_stop, Device::gantry},
     "a joint's position is believed however far it jumped"},
    {Cause::following_error,
     {Hazard::beyond, Hazard::falls},
     {Unsafe::T2},
     "a joint is held by a person or an obstacle, carries more than it can lift, or its drive is weaker than the robot "
     "file says",
     "measured position against the reference, beyond limits.following_error for feedback.following_timeout",
     {"pipeline_test Following.AJointThatIsHeldIsTold", "pipeline_test Following.DegradesUntilTheJointFollows"},
     "a robot that is only told goes on to push with up to limits.torque; what yields is not told from what follows",
     {Device::emergency_stop, Device::fence},
     "a joint that is held is behind no more"},
    {Cause::following_lost,
     {Hazard::beyond, Hazard::falls},
     {Unsafe::T2, Unsafe::S2},
     "as following_error, and the robot file stops the robot for it",
     "as following_error, with feedback.following: stop",
     {"pipeline_test Following.StopsAndLetsGo", "incident_test FollowingIncident.NamesTheJointAndTheDistance"},
     "it pushes with up to limits.torque until feedback.following_timeout is over; a robot that leans on what it "
     "touches is stopped there",
     {Device::emergency_stop, Device::gantry},
     "a following error that is to stop the robot is only told"},
    {Cause::command_late,
     {Hazard::outdated},
     {Unsafe::T1, Unsafe::T4, Unsafe::T6},
     "the policy is silent: a stall, a cut network, a death",
     "no usable command for degraded.after, or epsilon of freshness.window at one go",
     {"pipeline_test Freshness.PolicyDeathDegradesThenStopsWithinItsBound",
      "pipeline_test Freshness.AFreezeDegradesAndRecovers"},
     "until then the robot follows what was right max_age ago",
     {Device::fence, Device::gantry},
     "a silence degrades nothing"},
}};

namespace hazards_detail {

constexpr bool every_cause_has_its_row() {
  for (std::size_t i = 0; i < kRows.size(); ++i)
    if (static_cast<std::size_t>(kRows.at(i).cause) != i + 1 || pipeline::reaction(kRows.at(i).cause).severity == 0)
      return false;
  return true;
}

constexpr bool every_row_is_complete() {
  for (const Row& row : kRows) {
    if (row.hazards.empty() || row.unsafe.empty() || row.devices.empty()) return false;
    if (row.scenario.empty() || row.found.empty() || row.residual.empty()) return false;
    for (const Proof proof : row.proofs)
      if (!is_proof(proof)) return false;
  }
  return true;
}

// No unsafe action without a cause that answers it, but for those that are answered by how commands are played.
constexpr SetOf<Unsafe> kAnsweredByDesign{Unsafe::G1, Unsafe::G5, Unsafe::S2};

constexpr bool every_unsafe_action_has_its_cause() {
  for (const UnsafeRow& action : kUnsafe) {
    bool answered = kAnsweredByDesign.has(action.id);
    for (const Row& row : kRows) answered |= row.unsafe.has(action.id);
    if (!answered) return false;
  }
  return true;
}

// Where power is taken from what may carry weight, brakes or a gantry are named.
constexpr bool lost_power_is_covered() {
  for (const Row& row : kRows) {
    const pipeline::Scope& stops = pipeline::reaction(row.cause).stops;
    const bool takes_power = stops.joints == pipeline::Stop::category_0 || stops.robot == pipeline::Stop::category_0 ||
                             stops.robot == pipeline::Stop::category_1;
    if (takes_power && !(row.devices.has(Device::brakes) && row.devices.has(Device::gantry))) return false;
  }
  return true;
}

static_assert(every_cause_has_its_row());
static_assert(every_row_is_complete());
static_assert(every_unsafe_action_has_its_cause());
static_assert(lost_power_is_covered());

}  // namespace hazards_detail

}  // namespace takt::hazards
