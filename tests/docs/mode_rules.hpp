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
    Rule{"A command is usable while it is `fresh` or `aging`: at most `freshness.max_age` old. Older, it is `stale`.",
         "pipeline_test Freshness.TurnsAtTheExactInstant"},
    Rule{"A chunk is spent one `step_period` after its last step; its command is `missing` then.",
         "pipeline_test Freshness.ASpentChunkIsMissingUntilItIsStale"},
    Rule{"Age counts from the oldest sample that the policy used.",
         "pipeline_test Arrival.OutsideSensorsOnlyMakeOlder"},
};

inline constexpr std::array kSilenceRules{
    Rule{"Between `max_age` and the violation the robot still tracks: each joint brakes and then stays, with its own "
         "gains.",
         "pipeline_test Freshness.UntilASilenceIsLateEachJointBrakesWithItsOwnGains"},
    Rule{"A command that comes in time ends that at once; nothing is degraded, and no ramp begins.",
         "pipeline_test ResumeRamp.AlsoBeginsWithArmingAndWithNothingElse"},
    Rule{"`command_late` degrades the robot after more ticks in a row than `epsilon` of `freshness.window`.",
         "pipeline_test Freshness.SilenceIsLateAfterEpsilonOfTheWindow"},
    Rule{"So does a silence of `degraded.after`, where that is not 0: whichever is shorter.",
         "pipeline_test Freshness.SilenceIsLateAfterDegradeAfter"},
    Rule{"`contract_violated` degrades it on evidence that more than `epsilon` of all ticks have no usable command.",
         "pipeline_test Freshness.LateAgainAndAgainViolatesTheContract"},
    Rule{"Only ticks of tracking and degraded count; entering tracking forgets what was counted.",
         "pipeline_test Freshness.AFreezeDegradesAndRecovers"},
    Rule{"Tracking comes back once every tick had a usable command for `freshness.recover_after`; one miss starts the "
         "wait "
         "again.",
         "pipeline_test Recovery.OneMissStartsTheWaitAgain"},
    Rule{"A drive that is too hot, or a joint that is behind, keeps the robot degraded where it degrades it.",
         "pipeline_test Temperatures.DegradedByHeatItStaysSoUntilItIsCooler"},
    Rule{"`freshness.flap_memory` counts from the newest return to tracking. Degraded again within it, the next wait "
         "is twice "
         "as long, up to 16 times.",
         "pipeline_test Recovery.FlappingDoublesTheWaitUpToSixteenTimes"},
    Rule{"A later relapse, or an arming, makes the wait `recover_after` again.",
         "pipeline_test Recovery.FlappingDoublesTheWaitUpToSixteenTimes"},
    Rule{"Back in tracking, and after arming, speed limits rise from `degraded.speed_scale` to all of them within "
         "`degraded.resume_over`.",
         "pipeline_test ResumeRamp.SpeedLimitsRiseFromTheScaleToAllOfThemOverItsTime"},
    Rule{"`command_lost` stops the robot `freshness.stop_after` after the last tick with a usable command.",
         "pipeline_test Recovery.ACommandIsLostExactlyAfterStopAfter"},
    Rule{"While degraded, a usable command of the fallback policy counts for that too.",
         "pipeline_test FallbackPolicy.BothLostIsCommandLost"},
    Rule{"`degraded.for` stops the robot (`degraded_spent`), however fresh its commands are.",
         "pipeline_test DegradedFor.EndsInAStopWhateverTheBehaviour"},
};

inline constexpr std::array kGivenRules{
    Rule{"What a command leaves out is the joint's own: `gains.kp`, `gains.kd`, torque 0.",
         "pipeline_test ChunkPlayer.AbsentFieldsTakeTheJointsDefaults"},
    Rule{"Limits of gains, torque and torque rate hold in every row.",
         "pipeline_test Stabiliser.GainsBeyondTheirMaximumAreClampedAndSaid"},
    Rule{"The velocity setpoint is the reference's velocity; with `interpolation: hold` it is the step's own, else 0.",
         "pipeline_test TargetMeaning.HeldStepsSendNoVelocityAndHaveNone"},
    Rule{"A reference never leaves the joint's limits, nor a state from which it can brake inside them.",
         "pipeline_test Join.TheReferenceStaysInsideItsLimits"},
    Rule{"`slow` without a usable command brakes as in tracking; it does not creep on.",
         "pipeline_test Degraded.SlowPlaysOnAtReducedSpeedWhileFresh"},
    Rule{"`hold` ignores the policy, usable or not, until tracking comes back.",
         "pipeline_test Degraded.HoldBrakesToRestAndIgnoresThePolicy"},
    Rule{"Once at rest, a stopped robot holds where it stands, until a reset.",
         "pipeline_test DampedStop.ComesToRestHoldsAndWaitsForTheOperator"},
    Rule{"`how: hold` and `how: policy` last for `stops.NAME.for` (0 s: without end), then the stop goes on as `rest`.",
         "pipeline_test Stops.AHoldLastsForSoLongAndThenItIsDamped"},
    Rule{"A worse cause takes over a damped stop with its own `how`, and does not give it back.",
         "pipeline_test Stops.AWorseCauseTakesOverWithItsOwnManner"},
    Rule{"A drive whose power a fault took stays off until standby, even if it is heard again.",
         "pipeline_test Scope.ADriveThatIsHeardAgainStaysWithoutPowerUntilTheReset"},
};

inline constexpr std::array kStopRules{
    Rule{"A press is `takt stop`. `takt top`, Ctrl-C of `takt run`, DDS and a policy ask for a stop as a program does.",
         "reception_test ReceptionTest.APressIsAskedForOnceAlthoughItIsAnsweredElsewhere"},
    Rule{"A second press takes the power of every drive: 0.2 s or more after the first, until standby.",
         "pipeline_test OperatorStop.TheSecondPressTakesThePowerAway"},
    Rule{"To keep a robot stopped, press once: arming is refused until a reset. After a second press, or `--now`, it "
         "stands "
         "by without power, and one arming moves it.",
         "pipeline_test OperatorStop.AfterOnePressArmingIsRefusedAndAfterTwoItIsNot"},
    Rule{"A stop that a cause began, or a program, is no first press: the press after it is the first.",
         "pipeline_test OperatorStop.AStopThatNobodyAskedForIsNotAFirstPress"},
    Rule{"A program may repeat its stop without end; the power stays.",
         "pipeline_test OperatorStop.AProgramThatRepeatsItsStopNeverTakesThePower"},
    Rule{"A reset forgets the first press.", "pipeline_test OperatorStop.AResetForgetsTheFirstPress"},
    Rule{"A first press in `fault_latched` changes nothing, and counts as the first.",
         "pipeline_test OperatorStop.TheSecondPressTakesThePowerAway"},
    Rule{"`takt stop --now` takes the power in one tick, from every mode. Without power, what hangs falls.",
         "pipeline_test OperatorStop.DeenergisesInTheVeryTickFromEveryMode"},
    Rule{"A stop discards an arm, a reset or a swap that came with it.",
         "runtime_test OperatorInbox.AStopDiscardsWhatWouldGetTheRobotGoing"},
    Rule{"A stop while arming leaves drives off that are not enabled yet.",
         "pipeline_test OperatorStop.WhileArmingLeavesOffWhatIsStillOff"},
    Rule{"SIGTERM stops the robot, and ends the executive at rest, after 10 s at most.", "runtime_test Shutdown.Table"},
    Rule{"A second SIGTERM ends it at once.", "runtime_test Shutdown.ASecondSignalEndsItAtOnce"},
    Rule{"A stop that no tick reads within 0.1 s is taken all the same; `takt stop` says so, and ends with 0.",
         "reception_test ReceptionTest.AStopThatNoTickReadsIsTakenAndSaysSo"},
};

inline constexpr std::array kResetRules{
    Rule{"A reset is granted from `damped_stop` and `fault_latched`, at rest. It leads to standby and turns every "
         "drive off.",
         "pipeline_test Rest.ALatchedFaultIsResetAtRestOnly"},
    Rule{"At rest means: for 0.1 s each joint that is heard and has power moved no faster than "
         "`feedback.rest_velocity`.",
         "pipeline_test Rest.StepsOfAnEncoderAreNoMotion"},
    Rule{"That asks what hangs on a lost joint and sags, too.",
         "pipeline_test Rest.AResetWaitsForWhatHangsOnALostJointToo"},
    Rule{"It does not ask a joint without power.", "pipeline_test Rest.AJointWithoutPowerDelaysNoReset"},
    Rule{"From `fault_latched` it is refused while a cause holds that has \"yes\" under \"blocks a reset\" below.",
         "pipeline_test Faults.ResetWaitsUntilTheConditionIsGone"},
    Rule{
        "It is granted while a drive still reports its fault, and while other causes hold. What is left blocks arming.",
        "pipeline_test Faults.ResetIsGrantedWhileADriveStillReportsItsFault"},
    Rule{"While the fallback policy moves a stopped robot, a reset is refused: take the power.",
         "pipeline_test StopByPolicy.StandingStillUnderItIsNoRest"},
    Rule{"A reset does not wait: refused, it changes nothing, and is asked for again.",
         "pipeline_test Rest.AStoppedRobotThatIsPushedIsNotResetMeanwhile"},
    Rule{"A reset in standby accepts where joints read that moved while their drive was silent.",
         "pipeline_test JointWatch.AJointThatReadsElsewhereAfterASilenceIsNotArmedBeforeAPersonLooked"},
    Rule{"The reset that ends a stop does not accept that.",
         "pipeline_test JointWatch.TheResetThatEndsAStopDoesNotAcceptWhereAJointReads"},
    Rule{"No command of before a reset moves the robot after it.",
         "pipeline_test Epoch.NoCommandOfBeforeAResetMovesTheRobotAfterIt"},
};

inline constexpr std::array kArmRules{
    Rule{"An arm is granted in standby when nothing is missing; else everything that is missing is listed.",
         "pipeline_test Standby.ListsWhatArmingMisses"},
    Rule{"Arming ends in tracking once every drive is enabled and a command is usable; after "
         "`feedback.enable_timeout`, in a fault.",
         "pipeline_test Arming.GivesUpOnADriveThatDoesNotEnable"},
    Rule{"A drive that is still switched on in standby blocks it.",
         "pipeline_test Standby.ADriveThatIsStillOnBlocksArming"},
};

inline constexpr std::array kLimitRules{
    Rule{"A message too old, or overtaken by a newer answer, is no bad command: it only counts as late.",
         "pipeline_test Commands.LateOnesAreNoIntegrationError"},
    Rule{"Refusals and ticks out of range are forgotten with the window; until then they block arming.",
         "pipeline_test OutOfRange.MoreThanTheShareOfTheWindowStopsTheRobot"},
    Rule{"`integration errors` in `takt status` counts stamps that ran backwards. It stops nothing.",
         "pipeline_test Commands.BackwardStampsAreAnIntegrationErrorEach"},
    Rule{"Targets of the fallback policy out of range are counted alone, and lead to `fallback_spent`.",
         "pipeline_test StopByPolicy.ItsOwnNonsenseEndsItHoweverItWasStopped"},
};

}  // namespace takt::docs
