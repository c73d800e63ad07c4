// SPDX-License-Identifier: Apache-2.0
// What docs/modes.md says and no table of the executive has: one sentence per rule, and the test that fails when the
// rule does not hold.
#pragma once

#include <array>
#include <string_view>

namespace takt::docs {

struct Rule {
  std::string_view text;
  std::string_view proof;  // "PROGRAM Suite.Case"
};

inline constexpr std::array kUsableRules{
    Rule{"A command is usable while `fresh` or `aging`: at most `freshness.max_age` old. Older, it is `stale`.",
         "pipeline_test Freshness.TurnsAtTheExactInstant"},
    Rule{"A chunk is spent one `step_period` after its last step; its command is `missing` then.",
         "pipeline_test Freshness.ASpentChunkIsMissingUntilItIsStale"},
    Rule{"Age counts from the oldest sample that the policy used.",
         "pipeline_test Arrival.OutsideSensorsOnlyMakeOlder"},
};

inline constexpr std::array kSilenceRules{
    Rule{"Between `max_age` and the violation each joint brakes in tracking, with its own gains.",
         "pipeline_test Freshness.UntilASilenceIsLateEachJointBrakesWithItsOwnGains"},
    Rule{"A usable command ends that at once, without a ramp.",
         "pipeline_test ResumeRamp.AlsoBeginsWithArmingAndWithNothingElse"},
    Rule{"`command_late` degrades after more ticks in a row than `epsilon` of `freshness.window`.",
         "pipeline_test Freshness.SilenceIsLateAfterEpsilonOfTheWindow"},
    Rule{"So does a silence of `degraded.after`, if not 0: whichever is shorter.",
         "pipeline_test Freshness.SilenceIsLateAfterDegradeAfter"},
    Rule{"`contract_violated` degrades on evidence that more than `epsilon` of all ticks lack a usable command.",
         "pipeline_test Freshness.LateAgainAndAgainViolatesTheContract"},
    Rule{"Only ticks of tracking and degraded count; entering tracking resets the counts.",
         "pipeline_test Freshness.AFreezeDegradesAndRecovers"},
    Rule{"Tracking returns once every tick had a usable command for `freshness.recover_after`; one miss restarts the "
         "wait.",
         "pipeline_test Recovery.OneMissStartsTheWaitAgain"},
    Rule{"A hot drive or a joint that is behind keeps degraded what it degrades.",
         "pipeline_test Temperatures.DegradedByHeatItStaysSoUntilItIsCooler"},
    Rule{"A relapse within `freshness.flap_memory` of the return to tracking doubles the next wait, up to 16 times.",
         "pipeline_test Recovery.FlappingDoublesTheWaitUpToSixteenTimes"},
    Rule{"A later relapse or an arming resets the wait.",
         "pipeline_test Recovery.FlappingDoublesTheWaitUpToSixteenTimes"},
    Rule{"Back in tracking, and after arming, speed limits rise from `degraded.speed_scale` to full within "
         "`degraded.resume_over`.",
         "pipeline_test ResumeRamp.SpeedLimitsRiseFromTheScaleToAllOfThemOverItsTime"},
    Rule{"`command_lost` stops the robot `freshness.stop_after` after the last tick with a usable command, in degraded "
         "too.",
         "pipeline_test Recovery.ACommandIsLostExactlyAfterStopAfter"},
    Rule{"While degraded, a usable command of the fallback policy counts too.",
         "pipeline_test FallbackPolicy.BothLostIsCommandLost"},
    Rule{"`degraded.for` stops the robot (`degraded_spent`), however fresh its commands are.",
         "pipeline_test DegradedFor.EndsInAStopWhateverTheBehaviour"},
};

inline constexpr std::array kGivenRules{
    Rule{"A command's missing fields are the joint's `gains.kp`, `gains.kd`, torque 0.",
         "pipeline_test ChunkPlayer.AbsentFieldsTakeTheJointsDefaults"},
    Rule{"Limits of gains, torque and torque rate hold in every row.",
         "pipeline_test Stabiliser.GainsBeyondTheirMaximumAreClampedAndSaid"},
    Rule{"The velocity setpoint is the reference's; with `interpolation: hold` the step's own, else 0.",
         "pipeline_test TargetMeaning.HeldStepsSendNoVelocityAndHaveNone"},
    Rule{"A reference never leaves the joint's limits, and can always brake inside them.",
         "pipeline_test Join.TheReferenceStaysInsideItsLimits"},
    Rule{"At rest, a stopped robot holds where it stands, until a reset.",
         "pipeline_test DampedStop.ComesToRestHoldsAndWaitsForTheOperator"},
    Rule{"`how: hold` and `how: policy` last for `stops.NAME.for` (0 s: without end), then `rest` follows.",
         "pipeline_test Stops.AHoldLastsForSoLongAndThenItIsDamped"},
    Rule{"A worse cause takes over a damped stop with its own `how`, for good.",
         "pipeline_test Stops.AWorseCauseTakesOverWithItsOwnManner"},
    Rule{"A drive that a fault switched off stays off until standby, even if heard again.",
         "pipeline_test Scope.ADriveThatIsHeardAgainStaysWithoutPowerUntilTheReset"},
};

inline constexpr std::array kStopRules{
    Rule{
        "A press is `takt stop`. `takt top`, DDS and a policy stop as a program does; Ctrl-C of `takt run` is SIGTERM.",
        "reception_test ReceptionTest.APressIsAskedForOnceAlthoughItIsAnsweredElsewhere"},
    Rule{"A second press, another operator's too, takes the power of every drive: 0.2 s or more after the first, until "
         "standby.",
         "pipeline_test OperatorStop.TheSecondPressTakesThePowerAway"},
    Rule{"One press outside of standby: arming is refused until a reset, or the executive's end. After a second press, "
         "or `--now`, one arming moves it.",
         "pipeline_test OperatorStop.AfterOnePressArmingIsRefusedAndAfterTwoItIsNot"},
    Rule{"A stop by a cause or a program is no first press.",
         "pipeline_test OperatorStop.AStopThatNobodyAskedForIsNotAFirstPress"},
    Rule{"A reset forgets the first press.", "pipeline_test OperatorStop.AResetForgetsTheFirstPress"},
    Rule{"A first press in `fault_latched` changes nothing, but counts.",
         "pipeline_test OperatorStop.TheSecondPressTakesThePowerAway"},
    Rule{"`takt stop --now` takes the power in one tick, from every mode. Without power, what hangs falls.",
         "pipeline_test OperatorStop.DeenergisesInTheVeryTickFromEveryMode"},
    Rule{"A stop discards an arm, a reset or a swap that came with it.",
         "runtime_test OperatorInbox.AStopDiscardsWhatWouldGetTheRobotGoing"},
    Rule{"A stop while arming leaves drives off that are not yet enabled.",
         "pipeline_test OperatorStop.WhileArmingLeavesOffWhatIsStillOff"},
    Rule{"SIGTERM stops the robot; at rest, within 10 s, it takes the power and ends the executive.",
         "runtime_test Shutdown.Table"},
    Rule{"A second SIGTERM ends it at once.", "runtime_test Shutdown.ASecondSignalEndsItAtOnce"},
    Rule{"A stop that no tick reads within 0.1 s is taken; `takt stop` says so.",
         "reception_test ReceptionTest.AStopThatNoTickReadsIsTakenAndSaysSo"},
};

inline constexpr std::array kResetRules{
    Rule{"A reset is granted in `damped_stop` and `fault_latched`, at rest; it leads to standby, drives off.",
         "pipeline_test Rest.ALatchedFaultIsResetAtRestOnly"},
    Rule{"At rest: for 0.1 s each heard joint with power moved no faster than `feedback.rest_velocity`.",
         "pipeline_test Rest.StepsOfAnEncoderAreNoMotion"},
    Rule{"That includes what hangs on a lost joint and sags.",
         "pipeline_test Rest.AResetWaitsForWhatHangsOnALostJointToo"},
    Rule{"It excludes joints without power.", "pipeline_test Rest.AJointWithoutPowerDelaysNoReset"},
    Rule{"From `fault_latched` it is refused while a cause holds that blocks it, as named below.",
         "pipeline_test Faults.ResetWaitsUntilTheConditionIsGone"},
    Rule{"It is granted while a drive reports its fault or other causes hold; these block arming.",
         "pipeline_test Faults.ResetIsGrantedWhileADriveStillReportsItsFault"},
    Rule{"While the fallback policy moves a stopped robot, a reset is refused: take the power.",
         "pipeline_test StopByPolicy.StandingStillUnderItIsNoRest"},
    Rule{"A refused reset changes nothing: ask again.",
         "pipeline_test Rest.AStoppedRobotThatIsPushedIsNotResetMeanwhile"},
    Rule{"A reset in standby accepts positions of joints that moved while silent.",
         "pipeline_test JointWatch.AJointThatReadsElsewhereAfterASilenceIsNotArmedBeforeAPersonLooked"},
    Rule{"The reset that ends a stop does not accept that.",
         "pipeline_test JointWatch.TheResetThatEndsAStopDoesNotAcceptWhereAJointReads"},
    Rule{"No command from before a reset moves the robot.",
         "pipeline_test Epoch.NoCommandOfBeforeAResetMovesTheRobotAfterIt"},
};

inline constexpr std::array kArmRules{
    Rule{"An arm is granted in standby when nothing is missing; else it lists all that is missing.",
         "pipeline_test Standby.ListsWhatArmingMisses"},
    Rule{"Arming ends in tracking once every drive is enabled and a command is usable; else in a fault after "
         "`feedback.enable_timeout`.",
         "pipeline_test Arming.GivesUpOnADriveThatDoesNotEnable"},
    Rule{"A drive that is still switched on in standby blocks it.",
         "pipeline_test Standby.ADriveThatIsStillOnBlocksArming"},
};

inline constexpr std::array kLimitRules{
    Rule{"A message too old, or overtaken by a newer answer, counts as late, not as a bad command.",
         "pipeline_test Commands.LateOnesAreNoIntegrationError"},
    Rule{"Refusals and ticks out of range block arming until the window forgets them.",
         "pipeline_test OutOfRange.MoreThanTheShareOfTheWindowStopsTheRobot"},
    Rule{"`integration errors` in `takt status` counts stamps that ran backwards. It stops nothing.",
         "pipeline_test Commands.BackwardStampsAreAnIntegrationErrorEach"},
    Rule{"Out-of-range targets of the fallback policy are counted apart, and lead to `fallback_spent`.",
         "pipeline_test StopByPolicy.ItsOwnNonsenseEndsItHoweverItWasStopped"},
};

}  // namespace takt::docs
