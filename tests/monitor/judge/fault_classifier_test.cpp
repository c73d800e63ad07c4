// SPDX-License-Identifier: Apache-2.0
// Goal: every kind of fault is called by its name with its evidence, and calm runs by none.
// Method: a synthetic robot of two joints whose policy answers every 20 ms; one thing at a time is made to go wrong.
// The last tests take the recorded demo, whose policy stalls, and plant mistakes in the evidence.
#include "monitor/judge/fault_classifier.hpp"

#include <gtest/gtest.h>

#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr Duration kMaxAge = milliseconds(40);

// Ticks every millisecond; a command every 20 ms whose parts are 5 + 1 + 14 + 1 ms old at first use.
class Robot {
 public:
  TickRecord record;
  FaultClassifier classifier{{.max_age = kMaxAge,
                              .period = milliseconds(1),
                              .joints = {"hip", "knee"},
                              .content = {.sensors = {{.name = "base_imu"}}, .imu = 0}}};
  AgeParts parts{.sense = milliseconds(5),
                 .queue = milliseconds(1),
                 .infer = milliseconds(14),
                 .publish = milliseconds(1),
                 .hold = {}};
  Duration feedback_age = microseconds(300);
  bool policy_answers = true, drives_reply = true;

  Robot() {
    record.header.tick = 19;  // the first tick brings the first command
    record.header.joint_count = 2;
    record.header.bus_count = 1;
    record.header.now = MonoTime{1'000'000'000};
    record.header.mode = record.header.previous_mode = Mode::tracking;
  }

  // One tick; `change` has the last word on its record.
  template <class Change>
  void tick(const Change& change) {
    TickRecordHeader& header = record.header;
    ++header.tick;
    header.now = header.now + milliseconds(1);
    header.previous_mode = header.mode;
    header.seats[Seat::policy].arrival = Arrival::none;
    header.overrun_cause = OverrunCause::none;
    header.lateness = microseconds(5);
    header.age.hold = header.age.hold + milliseconds(1);
    if (policy_answers && header.tick % 20 == 0) arrive(parts);
    header.seats[Seat::policy].freshness = header.seats[Seat::policy].command_sequence == 0 ? Freshness::missing
                                           : header.age.total() > kMaxAge                   ? Freshness::stale
                                                                                            : Freshness::fresh;
    for (std::size_t joint = 0; joint < 2; ++joint) {
      record.joints[joint].feedback.received_at = header.now - feedback_age;
      if (drives_reply) ++record.joints[joint].feedback.replies;
    }
    change(header);
    classifier.tick(record);
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick([](TickRecordHeader&) {});
  }
  void arrive(const AgeParts& with) {
    record.header.seats[Seat::policy].arrival = Arrival::accepted;
    record.header.age = with;
    ++record.header.seats[Seat::policy].command_sequence;
  }
  void enter(Mode mode, Cause cause) {
    tick([&](TickRecordHeader& header) {
      header.mode = mode;
      header.cause = cause;
    });
  }
  std::vector<std::string> sentences() {
    std::vector<std::string> all;
    for (const FaultVerdict& verdict : classifier.finish().verdicts) all.push_back(verdict.sentence);
    return all;
  }
};
using Sentences = std::vector<std::string>;

TEST(FaultClassifier, ACalmRunHasNone) {
  Robot robot;
  robot.run(1000);
  EXPECT_EQ(robot.sentences(), Sentences{});
  EXPECT_EQ(fault_text({}), "faults        none\n");
}

TEST(FaultClassifier, AgePartThatStandsOutNamesTheFault) {
  const auto verdict_with = [](void (*change)(Robot&)) {
    Robot robot;
    robot.run(500);
    change(robot);
    robot.policy_answers = false;
    robot.run(50);
    robot.tick([&](TickRecordHeader& header) {  // the late command, accepted and stale at once
      robot.arrive(robot.parts);
      header.seats[Seat::policy].freshness = Freshness::stale;
    });
    robot.policy_answers = true;
    robot.parts = Robot().parts;
    robot.run(300);
    return robot.sentences();
  };
  EXPECT_EQ(verdict_with([](Robot& robot) { robot.parts.infer = milliseconds(212); }),
            Sentences{"inference_stall: tau_infer 212 ms against a median of 14 ms"});
  EXPECT_EQ(verdict_with([](Robot& robot) { robot.parts.queue = milliseconds(90); }),
            Sentences{"middleware_queue_growth: tau_queue 90 ms against a median of 1 ms"});
  EXPECT_EQ(verdict_with([](Robot& robot) { robot.parts.publish = milliseconds(60); }),
            Sentences{"middleware_queue_growth: tau_publish 60 ms against a median of 1 ms"});
  EXPECT_EQ(verdict_with([](Robot& robot) { robot.parts.sense = milliseconds(120); }),
            Sentences{"sensor_backlog: tau_sense 120 ms against a median of 5 ms, while joint feedback was at most 0.3 "
                      "ms old"});
  EXPECT_EQ(verdict_with([](Robot& robot) {
              robot.parts.sense = milliseconds(45);
              robot.feedback_age = milliseconds(41);
            }),
            Sentences{"estimator_lag: tau_sense 45 ms against a median of 5 ms; feedback of joint hip was 41 ms old "
                      "against a median of 0.3 ms"});
}

TEST(FaultClassifier, ASilentPolicyIsAStall) {
  Robot robot;
  robot.run(500);
  robot.policy_answers = false;
  robot.run(2000);
  EXPECT_EQ(
      robot.sentences(),
      Sentences{"inference_stall: no command came for 2019 ms, max_age is 40 ms; the policy host's log says whether a "
                "sensor, the policy or the way between failed"});
}

// Goal: a silence that stopped the robot is measured to the stop, as the incident does, and not to the end of the run.
// Method: a policy that falls silent, the stop 600 ms after, and two seconds in it.
TEST(FaultClassifier, ASilenceIsMeasuredToTheStopThatItMade) {
  Robot robot;
  robot.run(500);
  robot.policy_answers = false;
  robot.run(600);
  robot.tick([](TickRecordHeader& header) {
    header.mode = Mode::damped_stop;
    header.cause = Cause::command_lost;
  });
  robot.run(2000);
  EXPECT_EQ(
      robot.sentences(),
      Sentences{"inference_stall: no command came for 620 ms, max_age is 40 ms; the policy host's log says whether a "
                "sensor, the policy or the way between failed"});
}

// The command that explains a stall is refused, so its parts are not in any tick: they come from the command itself.
TEST(FaultClassifier, ReadsTheCommandThatWasRefusedForItsAge) {
  Robot robot;
  robot.run(500);
  robot.policy_answers = false;
  const MonoTime observed = robot.record.header.now + milliseconds(1);
  robot.tick([](TickRecordHeader& header) { header.observation_published = 7; });
  robot.record.header.observation_published = 0;
  robot.run(149);
  CommandChunk late;
  late.header.observation_id = 7;
  late.header.infer_started_at = observed + milliseconds(2);
  late.header.infer_ended_at = observed + milliseconds(149);
  robot.classifier.command(late);
  robot.tick([](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::expired_observation; });
  robot.policy_answers = true;
  robot.run(300);
  EXPECT_EQ(robot.sentences(), Sentences{"inference_stall: tau_infer 147 ms against a median of 14 ms"});
}

TEST(FaultClassifier, ACommandThatWasOvertakenIsTooLateNotWrong) {
  Robot robot;
  robot.run(500);
  robot.tick([](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::overtaken; });
  robot.run(300);
  for (const std::string& sentence : robot.sentences())
    EXPECT_EQ(sentence.find("controller_integration_error"), std::string::npos) << sentence;
}

TEST(FaultClassifier, ASuspendIsThePlatforms) {
  Robot robot;
  robot.run(500);
  robot.tick([](TickRecordHeader& header) {
    header.slept_ms = 3'200;
    header.mode = Mode::fault_latched;
    header.cause = Cause::feedback_lost;
  });
  EXPECT_EQ(robot.sentences(), Sentences{"platform_stall: the computer was suspended for 3.2 s"});
}

TEST(FaultClassifier, LostPeriodsAreTheSchedulersOrThePlatforms) {
  const auto verdict_with = [](OverrunCause cause) {
    Robot robot;
    robot.run(500);
    robot.tick([&](TickRecordHeader& header) {
      header.overrun_cause = cause;
      header.lateness = microseconds(8100);
      header.skipped_periods += 8;
    });
    robot.run(300);
    return robot.sentences();
  };
  const std::string what = ": the control loop woke up to 8.1 ms late, 8 periods skipped, cause recorded: ";
  EXPECT_EQ(verdict_with(OverrunCause::preempted), Sentences{"scheduler_preemption" + what + "preempted"});
  EXPECT_EQ(verdict_with(OverrunCause::blocked), Sentences{"scheduler_preemption" + what + "blocked"});
  EXPECT_EQ(verdict_with(OverrunCause::platform_stall), Sentences{"platform_stall" + what + "platform_stall"});
  EXPECT_EQ(verdict_with(OverrunCause::page_fault), Sentences{"platform_stall" + what + "page_fault"});
  EXPECT_EQ(verdict_with(OverrunCause::own_overrun), Sentences{"controller_integration_error" + what + "own_overrun"});
  EXPECT_EQ(verdict_with(OverrunCause::none), Sentences{"platform_stall" + what + "none"});
}

// Real machines lose a period now and then, also while the policy stalls.
TEST(FaultClassifier, OneLostPeriodDoesNotExplainALongSilence) {
  Robot robot;
  robot.run(500);
  robot.policy_answers = false;
  robot.run(100);
  robot.tick([](TickRecordHeader& header) {
    header.overrun_cause = OverrunCause::platform_stall;
    header.lateness = microseconds(1600);
    header.skipped_periods += 1;
  });
  robot.run(300);
  ASSERT_EQ(robot.sentences().size(), 1U);
  EXPECT_EQ(robot.sentences().front().substr(0, 15), "inference_stall");
}

// A command that waited for a control thread that did not run is not the middleware's fault.
TEST(FaultClassifier, ALatePublishOfALateThreadIsTheSchedulers) {
  Robot robot;
  robot.run(500);
  robot.tick([&](TickRecordHeader& header) {
    AgeParts late = robot.parts;
    late.publish = milliseconds(61);
    robot.arrive(late);
    header.seats[Seat::policy].freshness = Freshness::stale;
    header.lateness = milliseconds(60);
    header.skipped_periods += 60;
    header.overrun_cause = OverrunCause::preempted;
  });
  robot.run(300);
  EXPECT_EQ(robot.sentences(), Sentences{"scheduler_preemption: the control loop woke up to 60 ms late, 60 periods "
                                         "skipped, cause recorded: preempted"});
}

TEST(FaultClassifier, BadCommandsAreAnIntegrationError) {
  Robot robot;
  robot.run(500);
  robot.tick([](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::not_finite; });
  robot.tick([](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::wrong_shape; });
  robot.tick([](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::not_finite; });
  robot.run(300);
  robot.tick([](TickRecordHeader& header) { header.integration_errors += 2; });
  robot.run(300);
  EXPECT_EQ(robot.sentences(), (Sentences{"controller_integration_error: commands refused: wrong_shape 1, not_finite 2",
                                          "controller_integration_error: stamps of 2 commands ran backwards"}));
}

TEST(FaultClassifier, DrivesAndBuses) {
  {
    Robot robot;
    robot.run(500);
    robot.record.header.buses[0].state = BusState::bus_off;
    robot.enter(Mode::fault_latched, Cause::bus_off);
    robot.run(300);
    EXPECT_EQ(robot.sentences(),
              Sentences{"actuator_or_bus_fault: the executive reacted to bus_off, 284 of 284 replies came"});
  }
  {
    Robot robot;
    robot.run(500);
    robot.drives_reply = false;
    robot.run(20);
    robot.enter(Mode::fault_latched, Cause::feedback_lost);
    robot.run(300);
    EXPECT_EQ(robot.sentences(),
              Sentences{"actuator_or_bus_fault: the executive reacted to feedback_lost, 42 of 284 replies came"});
  }
  {
    Robot robot;
    robot.run(500);
    robot.feedback_age = milliseconds(25);
    robot.run(20);
    robot.enter(Mode::fault_latched, Cause::feedback_lost);
    robot.run(300);
    EXPECT_EQ(robot.sentences(), Sentences{"estimator_lag: feedback of joint hip was 25 ms old against a median of 0.3 "
                                           "ms, though 284 of 284 replies came"});
  }
}

// Drives that only answer are not heard while the loop itself stands still.
TEST(FaultClassifier, FeedbackLostInItsOwnSleepIsTheSchedulers) {
  Robot robot;
  robot.run(500);
  robot.feedback_age = milliseconds(50);
  robot.tick([](TickRecordHeader& header) {
    header.mode = Mode::fault_latched;
    header.cause = Cause::feedback_lost;
    header.overrun_cause = OverrunCause::preempted;
    header.lateness = milliseconds(50);
    header.skipped_periods += 50;
  });
  robot.feedback_age = microseconds(300);
  robot.run(300);
  EXPECT_EQ(robot.sentences(), Sentences{"scheduler_preemption: the control loop woke up to 50 ms late, 50 periods "
                                         "skipped, cause recorded: preempted"});
}

TEST(FaultClassifier, AWishIsNoFaultAndTheUnexplainedIsUnknown) {
  Robot robot;
  robot.run(500);
  robot.enter(Mode::damped_stop, Cause::operator_stop);
  robot.run(300);
  EXPECT_EQ(robot.sentences(), Sentences{});
  Robot pushed;
  pushed.run(500);
  pushed.enter(Mode::damped_stop, Cause::envelope_exceeded);
  pushed.run(300);
  EXPECT_EQ(pushed.sentences(),
            Sentences{"unknown: nothing stands out; the nearest is tau_sense 5 ms against a median of 5 ms"});
}

TEST(FaultClassifier, AnImuThatFallsSilentIsASensors) {
  Robot robot;
  robot.run(500);
  robot.enter(Mode::damped_stop, Cause::imu_lost);
  robot.run(300);
  EXPECT_EQ(robot.sentences(), Sentences{"sensor_backlog: the base's IMU gave no usable sample"});
}

// A process that ends and is started anew stays away for less than max_age beyond its last command: its age misses all
// the same, since that command was 21 ms old when it came.
TEST(FaultClassifier, APolicyThatComesBackAsAnotherSessionWasAStall) {
  Robot robot;
  robot.record.header.seats[Seat::policy].session = 1;
  robot.run(501);
  robot.policy_answers = false;
  robot.run(34);
  robot.policy_answers = true;
  robot.record.header.seats[Seat::policy].session = 2;
  robot.run(300);
  EXPECT_EQ(robot.sentences(),
            Sentences{"inference_stall: no command came for 40 ms, and the next were another policy process's"});
}

TEST(FaultClassifier, AStretchCostsWhatItMissed) {
  Robot robot;
  robot.run(501);
  robot.policy_answers = false;
  robot.run(200);
  robot.policy_answers = true;
  robot.run(300);
  robot.enter(Mode::damped_stop, Cause::drive_fault);
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  const FaultCost stall = summary.costs[static_cast<std::size_t>(Fault::inference_stall)];
  EXPECT_EQ(stall.stretches, 1U);
  EXPECT_EQ(stall.stops, 0U);
  EXPECT_NEAR(static_cast<double>(stall.missed_ticks), 200 - 20, 20) << "without a usable command";
  const FaultCost stop = summary.costs[static_cast<std::size_t>(Fault::actuator_or_bus_fault)];
  EXPECT_EQ(stop, (FaultCost{.stops = 1, .missed_ticks = 0, .troubled_ticks = 301, .stretches = 1}))
      << "standing costs, too";
  EXPECT_NEAR(summary.share(Fault::actuator_or_bus_fault), 301.0 / (301 + 180), 0.03);
  EXPECT_DOUBLE_EQ(summary.share(Fault::actuator_or_bus_fault) + summary.share(Fault::inference_stall), 1);
  EXPECT_EQ(FaultSummary().share(Fault::unknown), 0);
}

// Commands come late over the way, and half-way the scheduler takes periods from the loop: one stretch, two causes.
TEST(FaultClassifier, OneStretchHasTwoCauses) {
  Robot robot;
  robot.run(500);
  for (int command = 0; command < 20; ++command) {
    robot.parts.publish = milliseconds(38);
    robot.run(15);
    robot.tick([&](TickRecordHeader& header) {
      if (command < 10) return;
      header.overrun_cause = OverrunCause::preempted;
      header.lateness = milliseconds(2);
      header.skipped_periods += 2;
    });
    robot.run(4);
  }
  robot.parts = Robot().parts;
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  ASSERT_EQ(summary.verdicts.size(), 2U) << fault_text(summary);
  EXPECT_EQ(summary.counts[static_cast<std::size_t>(Fault::middleware_queue_growth)], 1U);
  EXPECT_EQ(summary.counts[static_cast<std::size_t>(Fault::scheduler_preemption)], 1U);
  EXPECT_NEAR(summary.share(Fault::scheduler_preemption), 1.0 / 3, 0.05) << "in half of the time";
}

// A hundred commands late over the way, one late by its inference: the one is no cause of its own.
TEST(FaultClassifier, ASlightCauseIsLeftOutOfAStretch) {
  Robot robot;
  robot.run(500);
  for (int command = 0; command < 100; ++command) {
    robot.parts.publish = milliseconds(command == 50 ? 1 : 38);
    robot.parts.infer = milliseconds(command == 50 ? 60 : 14);
    robot.run(20);
  }
  robot.parts = Robot().parts;
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  EXPECT_EQ(summary.verdicts.size(), 1U) << fault_text(summary);
  EXPECT_DOUBLE_EQ(summary.share(Fault::middleware_queue_growth), 1);
}

TEST(FaultClassifier, AStretchOfManyCommandsStaysSmallAndKeepsItsCost) {
  Robot robot;
  robot.run(500);
  robot.parts.publish = milliseconds(38);
  robot.run(40'000);
  robot.parts = Robot().parts;
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  ASSERT_EQ(summary.verdicts.size(), 1U) << fault_text(summary);
  EXPECT_NEAR(static_cast<double>(summary.verdicts.front().troubled_ticks), 40'000, 50);
}

// The policy host answers nothing once its sensor is too old for it: the commands before tell.
TEST(FaultClassifier, ASilenceAfterOldSamplesIsTheSensors) {
  Robot robot;
  robot.run(500);
  robot.parts.sense = milliseconds(30);
  robot.run(40);
  robot.policy_answers = false;
  robot.run(200);
  robot.policy_answers = true;
  robot.parts = Robot().parts;
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  ASSERT_EQ(summary.verdicts.size(), 1U) << fault_text(summary);
  EXPECT_EQ(summary.verdicts.front().fault, Fault::sensor_backlog) << fault_text(summary);
}

TEST(FaultClassifier, ATargetOutOfRangeIsAnIntegrationError) {
  Robot robot;
  robot.record.header.player = Player::policy;
  robot.run(500);
  robot.record.joints[1].interventions = bit(Intervention::target_range);
  robot.run(10);
  robot.record.joints[1].interventions = bit(Intervention::torque_limit);
  robot.run(300);
  EXPECT_EQ(robot.sentences(),
            Sentences{"controller_integration_error: targets out of their joints' range in 10 ticks"});
  Robot fallback;
  fallback.record.header.player = Player::fallback;
  fallback.run(500);
  fallback.record.joints[1].interventions = bit(Intervention::target_range);
  fallback.run(10);
  EXPECT_EQ(fallback.sentences(), Sentences{}) << "not the policy's target";
}

// Which its targets follow, out of range.
TEST(FaultClassifier, AnImuThatRepeatsItsValuesIsASensors) {
  Robot robot;
  robot.record.header.player = Player::policy;
  const auto sample = [&](int tick, float turn) {
    robot.record.header.imu.sequence = static_cast<std::uint64_t>(tick + 1);
    robot.record.header.imu.sensed_at = robot.record.header.now;
    robot.record.header.imu.angular_velocity[1] = turn;
    robot.run(1);
  };
  for (int tick = 0; tick < 500; ++tick) sample(tick, static_cast<float>(tick));
  for (int tick = 500; tick < 520; ++tick) sample(tick, 3.5F);
  robot.record.joints[0].interventions = bit(Intervention::target_range);
  for (int tick = 520; tick < 530; ++tick) sample(tick, 3.5F);
  robot.record.joints[0].interventions = 0;
  robot.run(300);
  const auto sentences = robot.sentences();
  ASSERT_EQ(sentences.size(), 1U);
  EXPECT_TRUE(
      sentences.front().starts_with("sensor_backlog: sensor base_imu repeated its values under fresh stamps in 29"))
      << sentences.front();
}

// Replies that are lost leave a joint old; replies that are late come, and leave it old all the same.
TEST(FaultClassifier, OneSilentDriveOfManyIsNoLag) {
  Robot robot;
  robot.run(500);
  for (int tick = 0; tick < 25; ++tick) {
    robot.tick([&](TickRecordHeader& header) {
      robot.record.joints[1].feedback.received_at = header.now - milliseconds(tick);
      --robot.record.joints[1].feedback.replies;
    });
  }
  robot.enter(Mode::fault_latched, Cause::feedback_lost);
  robot.run(300);
  const auto sentences = robot.sentences();
  ASSERT_EQ(sentences.size(), 1U);
  EXPECT_TRUE(sentences.front().starts_with("actuator_or_bus_fault: ")) << sentences.front();
}

// The loop stood still, and a drive that missed its commands gave up.
TEST(FaultClassifier, ADriveThatWaitedInVainIsTheSchedulers) {
  Robot robot;
  robot.run(500);
  robot.tick([](TickRecordHeader& header) { header.lateness = milliseconds(92); });
  robot.tick([](TickRecordHeader& header) {
    header.mode = Mode::fault_latched;
    header.cause = Cause::drive_fault;
    header.overrun_cause = OverrunCause::preempted;
    header.skipped_periods += 92;
  });
  robot.run(300);
  const auto sentences = robot.sentences();
  ASSERT_EQ(sentences.size(), 1U);
  EXPECT_TRUE(sentences.front().starts_with("scheduler_preemption: ")) << sentences.front();
}

TEST(FaultClassifier, TroublesFarApartAreTwoAndNearOnesAreOne) {
  Robot robot;
  robot.run(500);
  const auto refuse = [](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::corrupt; };
  robot.tick(refuse);
  robot.run(90);
  robot.tick(refuse);
  robot.run(110);
  robot.tick(refuse);
  robot.run(200);
  EXPECT_EQ(robot.sentences(), (Sentences{"controller_integration_error: commands refused: corrupt 2",
                                          "controller_integration_error: commands refused: corrupt 1"}));
}

// What stopped the robot comes first, what cost nothing but a late wake-up last, and many of those are one line.
TEST(FaultText, OrdersByGravityAndGroupsLateWakeUps) {
  Robot robot;
  robot.run(500);
  for (const int late_ms : {2, 7, 3}) {
    robot.tick([&](TickRecordHeader& header) {
      header.lateness = milliseconds(late_ms);
      header.overrun_cause = OverrunCause::platform_stall;
    });
    robot.run(300);
  }
  robot.tick([](TickRecordHeader& header) { header.seats[Seat::policy].arrival = Arrival::corrupt; });
  robot.run(300);
  robot.enter(Mode::damped_stop, Cause::envelope_exceeded);
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  ASSERT_EQ(summary.total(), 5U);
  const std::string text = fault_text(summary);
  const std::size_t stop = text.find("STOPPED: unknown"), missed = text.find("commands refused: corrupt 1");
  const std::size_t late = text.find("3 times  no miss: platform_stall: the control loop woke up late, at tick ");
  EXPECT_TRUE(stop < missed && missed < late && late != std::string::npos) << text;
  EXPECT_NE(text.find(" by 7 ms\n"), std::string::npos) << text;
  EXPECT_EQ(std::ranges::count(text, '\n'), 4) << text;
  EXPECT_TRUE(fault_text(summary, 2).ends_with("  and 3 more\n")) << fault_text(summary, 2);
}

// More than are listed: the gravest stay, however late they came.
TEST(FaultSummaryList, KeepsTheGravest) {
  Robot robot;
  robot.run(500);
  for (std::size_t i = 0; i < kListedVerdicts + 2; ++i) {
    robot.tick([](TickRecordHeader& header) { header.overrun_cause = OverrunCause::platform_stall; });
    robot.run(110);
  }
  robot.enter(Mode::damped_stop, Cause::envelope_exceeded);
  robot.run(300);
  const FaultSummary summary = robot.classifier.finish();
  EXPECT_EQ(summary.total(), kListedVerdicts + 3);
  ASSERT_EQ(summary.verdicts.size(), kListedVerdicts);
  EXPECT_EQ(summary.verdicts.back().gravity, Gravity::stopped);
  EXPECT_TRUE(std::ranges::is_sorted(summary.verdicts, {}, &FaultVerdict::first_tick));
}

class FaultsOfARun : public test::TemporaryFolder {};

TEST_F(FaultsOfARun, TheDemosFrozenPolicyIsAStall) {
  const RecordedRun run = record_demo(path("run"));
  const FaultSummary summary = classify_run(run).value();
  EXPECT_EQ(summary.counts[static_cast<std::size_t>(Fault::inference_stall)], summary.verdicts.size())
      << fault_text(summary);
  EXPECT_EQ(summary.verdicts.size(), 2U) << fault_text(summary);
  EXPECT_EQ(summary.verdicts[0].gravity, Gravity::missed);
  EXPECT_EQ(summary.verdicts[1].gravity, Gravity::stopped) << "the second stall stopped the robot";
  EXPECT_TRUE(fault_text(summary, 1).starts_with("faults        inference_stall 2\n  tick "));
  EXPECT_NE(fault_text(summary, 1).find("  STOPPED: inference_stall: "), std::string::npos) << fault_text(summary, 1);
  EXPECT_TRUE(fault_text(summary, 1).ends_with("  and 1 more\n"));
  EXPECT_EQ(to_json(summary)["counts"]["inference_stall"], 2);
}

}  // namespace
}  // namespace takt::monitor
