// SPDX-License-Identifier: Apache-2.0
// Goal: one incident per stop or fault, with the joint or bus, the drive's own words, what came before it, and one
// sentence that says it all. Method: ticks made by hand, one story each; every cause of the reaction table is entered
// once.
#include "executive/incident/incident.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "config/load.hpp"
#include "executive/pipeline/mode_machine.hpp"

namespace takt {
namespace {

class IncidentTest : public testing::Test {
 protected:
  IncidentTest() {
    record.header.joint_count = static_cast<std::uint32_t>(robot.joints.size());
    record.header.bus_count = static_cast<std::uint8_t>(robot.buses.size());
    record.header.seats[Seat::policy].freshness = Freshness::fresh;
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
      record.joints[joint].feedback.drive_state = DriveState::enabled;
    enter(Mode::arming, Cause::operator_arm);
    enter(Mode::tracking, Cause::drives_enabled);
  }
  // One tick later, in `mode`.
  std::optional<incident::Incident> enter(Mode mode, Cause cause) {
    TickRecordHeader& header = record.header;
    ++header.tick;
    header.now = MonoTime{} + milliseconds(static_cast<std::int64_t>(1000 + header.tick));
    header.previous_mode = header.mode;
    header.mode = mode;
    header.cause = cause;
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
      if (joint != silent) record.joints[joint].feedback.received_at = header.now;
    return watch.tick(record);
  }
  void stay(int ticks) {
    for (int i = 0; i < ticks; ++i) EXPECT_FALSE(enter(record.header.mode, Cause::none));
  }

  config::RobotConfig robot = config::load("config/arm6.yaml").value();
  std::unique_ptr<TickRecord> memory = std::make_unique<TickRecord>();
  TickRecord& record = *memory;
  std::size_t silent = 99;
  incident::IncidentWatch watch{robot};
};

TEST_F(IncidentTest, AnOverTemperatureIsToldInTheDrivesOwnWords) {
  stay(98);
  record.joints[2].feedback.drive_state = DriveState::fault;
  record.joints[2].feedback.error_code = 0xB;
  const auto incident = enter(Mode::fault_latched, Cause::drive_fault);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->where, "joint elbow");
  EXPECT_EQ(incident->error_code, 0xBU);
  EXPECT_FALSE(incident->asked);
  EXPECT_EQ(incident->clears_when, pipeline::reaction(Cause::drive_fault).clears_when);
  EXPECT_EQ(incident->sentence, "fault at tick 101: drive_fault: joint elbow: output stage over-temperature; done: " +
                                    incident->done + "; clears with: " + incident->clears_when);
  EXPECT_TRUE(watch.stands());
  stay(5);
  EXPECT_TRUE(watch.stands());
  EXPECT_FALSE(enter(Mode::standby, Cause::operator_reset));
  EXPECT_FALSE(watch.stands());
  EXPECT_TRUE(watch.latest()) << "what is over is still remembered";
}

// Reviews read files, and a file may say anything.
TEST_F(IncidentTest, ACauseThatDoesNotExistIsToldAsOne) {
  stay(5);
  for (const std::size_t beyond : {kCauseCount, std::size_t{200}, std::size_t{255}}) {
    const auto incident = enter(Mode::damped_stop, static_cast<Cause>(beyond));
    ASSERT_TRUE(incident);
    EXPECT_NE(incident->sentence.find("invalid"), std::string::npos) << incident->sentence;
    EXPECT_EQ(incident->clears_when, "unknown: the record names a cause that does not exist");
    enter(Mode::tracking, Cause::drives_enabled);
  }
}

// Every joint is silent at once when the computer stood still: that comes first, before any joint.
TEST_F(IncidentTest, AStallOfTheComputerIsNamedBeforeTheSilenceItMade) {
  stay(48);  // up to tick 50
  record.header.lateness = milliseconds(43);
  const auto at_once = enter(Mode::fault_latched, Cause::feedback_lost);
  ASSERT_TRUE(at_once);
  EXPECT_EQ(at_once->chain.front().what, "the control loop stood still for 43.0 ms");
  EXPECT_EQ(at_once->chain.front().at, at_once->at - milliseconds(43));
  EXPECT_NE(at_once->sentence.find("first sign 43.0 ms before, at tick 51: the control loop stood still"),
            std::string::npos)
      << at_once->sentence;
  record.header.lateness = {};
  enter(Mode::standby, Cause::operator_reset);
  enter(Mode::arming, Cause::operator_arm);
  enter(Mode::tracking, Cause::drives_enabled);
  stay(200);
  record.header.lateness = milliseconds(12);
  stay(1);
  record.header.lateness = {};
  record.header.overrun_cause = OverrunCause::platform_stall;
  stay(1);
  record.header.overrun_cause = OverrunCause::none;
  silent = 4;
  stay(10);
  const auto later = enter(Mode::fault_latched, Cause::feedback_lost);
  ASSERT_TRUE(later);
  EXPECT_EQ(later->chain.front().what, "the control loop stood still for 12.0 ms (platform_stall)");
  EXPECT_EQ(later->chain[1].what, "joint " + robot.joints[4].name + ": silent");
}

TEST_F(IncidentTest, ALateTickOfLittleOrOfLongAgoIsNoSign) {
  record.header.lateness = milliseconds(2);
  stay(20);
  record.header.lateness = milliseconds(43);
  stay(1);
  record.header.lateness = {};
  stay(110);
  const auto incident = enter(Mode::fault_latched, Cause::feedback_lost);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->chain.size(), 1U) << incident->chain.front().what;
}

TEST_F(IncidentTest, TheChainLeadsBackToTheFirstDeviatingTick) {
  stay(48);  // up to tick 50
  silent = 4;
  stay(10);
  record.header.seats[Seat::policy].freshness = Freshness::stale;
  stay(10);
  const auto incident = enter(Mode::fault_latched, Cause::feedback_lost);
  ASSERT_TRUE(incident);
  ASSERT_EQ(incident->chain.size(), 3U);
  EXPECT_EQ(incident->chain[0].tick, 51U);
  EXPECT_EQ(incident->chain[0].what, "joint wrist_pitch: silent");
  EXPECT_EQ(incident->chain[1].tick, 61U);
  EXPECT_EQ(incident->chain[1].what, "no usable command");
  EXPECT_EQ(incident->chain[2].tick, 71U);
  EXPECT_NE(incident->sentence.find("joint wrist_pitch: silent for 21.0 ms"), std::string::npos) << incident->sentence;
  EXPECT_NE(incident->sentence.find("first sign 20.0 ms before, at tick 51: joint wrist_pitch: silent"),
            std::string::npos)
      << incident->sentence;
}

// What was over long before the stop is not its beginning, nor what was there before the robot was armed.
TEST_F(IncidentTest, OldSignsAreForgotten) {
  record.header.buses[1].state = BusState::error_passive;
  stay(10);
  record.header.buses[1].state = BusState::up;
  stay(150);
  const auto incident = enter(Mode::damped_stop, Cause::command_lost);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->chain.size(), 1U);

  enter(Mode::standby, Cause::operator_reset);
  record.header.buses[1].state = BusState::error_passive;
  stay(10);
  record.header.buses[1].state = BusState::up;
  enter(Mode::arming, Cause::operator_arm);
  EXPECT_EQ(enter(Mode::fault_latched, Cause::enable_timeout)->chain.size(), 1U);
}

// A sign that ended shortly before the stop is still its beginning.
TEST_F(IncidentTest, ASignThatJustEndedIsRemembered) {
  record.header.buses[1].state = BusState::error_passive;
  stay(10);
  record.header.buses[1].state = BusState::up;
  stay(90);
  EXPECT_EQ(enter(Mode::damped_stop, Cause::command_lost)->chain.front().what, "bus can1: error_passive");
}

TEST_F(IncidentTest, ABusIsNamed) {
  record.header.buses[1].state = BusState::down;
  const auto incident = enter(Mode::fault_latched, Cause::bus_down);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->where, "bus can1");
  EXPECT_NE(incident->sentence.find("bus_down: bus can1: down or gone"), std::string::npos) << incident->sentence;
}

TEST_F(IncidentTest, WhatAPersonAskedForIsNoFault) {
  const auto stop = enter(Mode::damped_stop, Cause::operator_stop);
  ASSERT_TRUE(stop);
  EXPECT_TRUE(stop->asked);
  EXPECT_TRUE(stop->sentence.starts_with("stop asked for at tick 3: operator_stop")) << stop->sentence;
  // A fault that catches up with it is another matter.
  record.joints[0].feedback.error_code = 0xB;
  const auto fault = enter(Mode::fault_latched, Cause::drive_fault);
  ASSERT_TRUE(fault);
  EXPECT_FALSE(fault->asked);
}

// Goal: an arm that fell because a person took its power is on record, in words that say so.
TEST_F(IncidentTest, PowerTakenByAPersonIsAnIncidentToo) {
  const auto taken = enter(Mode::standby, Cause::operator_deenergise);
  ASSERT_TRUE(taken);
  EXPECT_TRUE(taken->asked);
  EXPECT_FALSE(watch.stands());
  EXPECT_NE(taken->done.find("lost its power"), std::string::npos) << taken->done;
}

TEST_F(IncidentTest, ARobotThatRunsOnIsNoIncident) {
  EXPECT_FALSE(enter(Mode::degraded, Cause::command_late));
  EXPECT_FALSE(enter(Mode::tracking, Cause::contract_restored));
  EXPECT_FALSE(watch.latest());
}

TEST_F(IncidentTest, TargetsOutOfRangeAreToldWithTheirJoint) {
  record.joints[3].interventions = bit(Intervention::target_range);
  stay(300);
  record.joints[3].interventions = 0;
  const auto incident = enter(Mode::damped_stop, Cause::bad_commands);
  ASSERT_TRUE(incident);
  EXPECT_NE(incident->detail.find("out of range in more than 25 % of the window (clamped_share), last of joint " +
                                  robot.joints[3].name),
            std::string::npos)
      << incident->detail;
  EXPECT_EQ(incident->chain.front().what, "joint " + robot.joints[3].name + ": target out of range");
}

// A gain far beyond its limit is brought into its range like a target, and was told as one.
TEST_F(IncidentTest, GainsOutOfRangeAreToldAsGains) {
  record.joints[3].interventions =
      static_cast<InterventionMask>(bit(Intervention::target_range) | bit(Intervention::gain_limit));
  stay(300);
  record.joints[3].interventions = 0;
  const auto incident = enter(Mode::damped_stop, Cause::bad_commands);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->detail.find("the policy's gains or targets were out of range"), 0U) << incident->detail;
  EXPECT_NE(incident->detail.find("held at limits.kp and limits.kd"), std::string::npos) << incident->detail;
  EXPECT_EQ(incident->chain.front().what, "joint " + robot.joints[3].name + ": gain or target out of range");
}

// The executive sees that no command came, and not whose fault it is.
TEST_F(IncidentTest, ASilentWireIsNotBlamedOnThePolicy) {
  record.header.seats[Seat::policy].freshness = Freshness::missing;
  stay(300);
  const auto incident = enter(Mode::damped_stop, Cause::command_lost);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->detail.find("no usable command came for "), 0U) << incident->detail;
  EXPECT_NE(incident->detail.find("the policy host's log says whether a sensor"), std::string::npos);
}

// Whatever stops the robot is told in words: the place, or for the robot as a whole why.
TEST_F(IncidentTest, EveryCauseThatStopsHasWordsOrAPlace) {
  for (config::Joint& joint : robot.joints) joint.limits.temperature = {.warning = 70, .stop = 80};
  watch = incident::IncidentWatch(robot);
  for (const auto& [mode, cause] : incident::possible_transitions()) {
    if (!pipeline::is_latched(mode)) continue;
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
      JointRecord& each = record.joints[joint];
      each.feedback.drive_state = cause == Cause::drive_disabled ? DriveState::disabled : DriveState::fault;
      each.dq_estimate = 99;
      each.feedback.temperature_C = 90;
      each.reply_faults = 0xFF;
      each.behind = 1;
    }
    for (BusHealth& bus : record.header.buses)
      bus.flooded = 1, bus.tx_dropped = bus.rx_dropped = bus.foreign_frames = 3;
    const BusState state = cause == Cause::bus_off    ? BusState::bus_off
                           : cause == Cause::bus_down ? BusState::down
                                                      : BusState::error_passive;
    for (BusHealth& bus : record.header.buses) bus.state = state;
    silent = cause == Cause::feedback_lost ? 0 : 99;
    record.joints[0].feedback.received_at = {};
    enter(Mode::tracking, Cause::drives_enabled);
    const auto incident = enter(mode, cause);
    ASSERT_TRUE(incident) << name(cause);
    EXPECT_FALSE(incident->detail.empty()) << name(cause);
    EXPECT_FALSE(incident->clears_when.empty()) << name(cause);
    EXPECT_NE(incident->sentence.find(incident->detail), std::string::npos);
    EXPECT_EQ(incident->sentence.find('\n'), std::string::npos);
  }
}

class ImuIncident : public IncidentTest {
 protected:
  ImuIncident() {
    robot.imu = config::Imu{.sensor = "torso", .tilt = 1.0, .angular_velocity = 6.0, .frozen_after = {}};
    record.header.imu.sequence = 1;
    record.header.imu_verdict = ImuVerdict::usable;
  }
  std::string detail_of(Cause cause) {
    watch = incident::IncidentWatch(robot);
    enter(Mode::tracking, Cause::drives_enabled);
    record.header.imu.sensed_at = record.header.now - milliseconds(49);
    return enter(Mode::damped_stop, cause)->detail;
  }
};

TEST_F(ImuIncident, SaysHowFarTheBaseLeans) {
  record.header.imu.rotation[0] = 0.8F;
  record.header.imu.rotation[1] = 0.6F;
  record.header.imu.angular_velocity[1] = 2;
  EXPECT_EQ(detail_of(Cause::tilt),
            "the base leans 1.29 rad from upright (imu.tilt 1) and turns at 2.00 rad/s (imu.angular_velocity 6)");
}

struct FallbackIncident : IncidentTest {
  FallbackIncident() {
    robot.degraded.behaviour = config::Degraded::fallback;
    robot.degraded.fallback = "stand";
    config::Fallback& stand = robot.fallbacks.emplace_back();
    stand.name = "stand";
    stand.kind = config::FallbackKind::policy;
    stand.longest = seconds(20);
    watch = incident::IncidentWatch(robot);
    enter(Mode::tracking, Cause::drives_enabled);
    record.header.seats[Seat::policy].freshness = Freshness::missing;
    record.header.player = Player::fallback;
    enter(Mode::degraded, Cause::command_late);
  }
};

TEST_F(FallbackIncident, BothLostAreNamedAndTheChainSaysWhoTookOver) {
  stay(300);
  record.header.player = Player::none;
  stay(600);
  const auto incident = enter(Mode::damped_stop, Cause::command_lost);
  ASSERT_TRUE(incident);
  EXPECT_EQ(
      incident->detail,
      "no usable command came for 600 ms (stop_after), of the fallback policy stand neither, none is left; the policy "
      "host's log says whether a sensor, the policy or the way between failed");
  ASSERT_GE(incident->chain.size(), 2U);
  const auto took_over = [](const incident::IncidentLink& link) {
    return link.what == "the fallback policy stand took over";
  };
  EXPECT_TRUE(std::ranges::any_of(incident->chain, took_over));
}

// Goal: no text says that a robot without a model was damped to rest. Method: the demo arm with and without its
// model, and as a robot with a free base.
TEST_F(IncidentTest, WithoutAModelItSaysWhatAStopDoes) {
  const auto done = [this](Mode mode, Cause cause) {
    watch = incident::IncidentWatch(robot);
    enter(Mode::tracking, Cause::drives_enabled);
    const auto incident = enter(mode, cause);
    EXPECT_TRUE(incident);
    return incident ? incident->done : "";
  };
  const std::string held = "braked joint by joint and held by stiffness alone, as it has no `model`";
  EXPECT_EQ(done(Mode::damped_stop, Cause::operator_stop), "the robot is damped to rest and held");
  EXPECT_EQ(done(Mode::damped_stop, Cause::shutdown), "the robot is damped to rest, then loses its power");
  robot.model.reset();
  EXPECT_EQ(done(Mode::damped_stop, Cause::operator_stop), "the robot is " + held);
  EXPECT_EQ(done(Mode::damped_stop, Cause::shutdown), "the robot is " + held + ", then loses its power");
  EXPECT_EQ(done(Mode::fault_latched, Cause::drive_fault),
            "the failed drives get no power, the rest of the robot is " + held + "; the fault stays latched");
  robot.stops = {{"operator_stop", config::StopHow::hold, seconds(2), "none"}};
  EXPECT_EQ(done(Mode::damped_stop, Cause::operator_stop), "the robot is braked and held, after 2 s " + held);
  robot.stops.clear();
  robot.imu.emplace();
  EXPECT_EQ(done(Mode::damped_stop, Cause::operator_stop),
            "the robot is damped until it rests and then held; it has no `model`, so what its joints carry falls");
  EXPECT_EQ(done(Mode::fault_latched, Cause::drive_fault),
            "the failed drives get no power, every other joint damps and is never held, as the robot has no `model`; "
            "what they carry falls; the fault stays latched")
      << "a free base without a model damps as a whole (Limbs)";
}

// Goal: the entry into degraded has its cause, tick and measure, as a stop has. Method: each cause that degrades, with
// either limit of a silence.
TEST_F(IncidentTest, ADegradedRobotIsToldWithCauseTickAndMeasure) {
  enter(Mode::degraded, Cause::command_late);
  record.header.age.hold = milliseconds(160);
  const auto said = [this](Cause cause) {
    record.header.cause = cause;
    return incident::degraded_sentence(record, robot);
  };
  const std::string begin = "degraded at tick " + std::to_string(record.header.tick) + ": ";
  EXPECT_EQ(said(Cause::command_late),
            begin +
                "command_late: no usable command came for 10 ms (freshness.epsilon of freshness.window); the newest "
                "is 160 ms old");
  robot.degraded.after = milliseconds(5);
  EXPECT_EQ(said(Cause::command_late),
            begin + "command_late: no usable command came for 5 ms (degraded.after); the newest is 160 ms old");
  record.header.window_misses = 12;
  record.header.window_ticks = 900;
  record.header.seats[Seat::policy].freshness = Freshness::missing;
  EXPECT_EQ(said(Cause::contract_violated),
            begin +
                "contract_violated: 12 of the window's 900 ticks had no usable command (freshness.epsilon 0.01); "
                "none is left");
  robot.joints[2].limits.temperature = config::TemperatureLimits{.warning = 80, .stop = 90};
  record.joints[2].feedback.temperature_C = 85;
  EXPECT_EQ(said(Cause::temperature_high),
            begin + "temperature_high: joint elbow: at 85 degC, beyond temperature.warning 80");
}

// Goal: the incident says what is done about the stop, as the robot file has it, and not what others do.
TEST_F(FallbackIncident, SaysHowTheRobotIsStopped) {
  using config::StopHow;
  const auto done = [&](const char* cause, StopHow how, Duration longest = {}) {
    robot.stops = {{cause, how, longest, "none"}};
    watch = incident::IncidentWatch(robot);
    enter(Mode::tracking, Cause::drives_enabled);
    const auto incident = enter(Mode::damped_stop, Cause::bad_commands);
    EXPECT_TRUE(incident);
    return incident ? incident->done : "";
  };
  EXPECT_EQ(done("tilt", StopHow::damping), "the robot is damped to rest and held");
  EXPECT_EQ(done("bad_commands", StopHow::damping), "the robot is damped, and never held");
  EXPECT_EQ(done("bad_commands", StopHow::hold), "the robot is braked and held");
  EXPECT_EQ(done("bad_commands", StopHow::hold, seconds(2)),
            "the robot is braked and held, after 2 s damped to rest and held");
  EXPECT_EQ(
      done("bad_commands", StopHow::policy, seconds(5)),
      "the fallback policy moves the robot as long as it has something to say, after 5 s damped to rest and held");
  record.header.player = Player::none;
  EXPECT_EQ(done("bad_commands", StopHow::policy, seconds(5)), "the robot is damped to rest and held")
      << "it had nothing to say";
}

TEST_F(FallbackIncident, SaysThatItsTimeIsOver) {
  stay(10);
  const auto incident = enter(Mode::damped_stop, Cause::fallback_spent);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->detail,
            "the fallback policy stand has moved the robot for 20 s (fallbacks.stand.for), and the policy is not back: "
            "none is left");
}

TEST_F(FallbackIncident, SaysThatItTalkedNonsense) {
  record.joints[1].interventions = static_cast<InterventionMask>(bit(Intervention::target_range));
  stay(10);
  record.joints[1].interventions = 0;
  const auto incident = enter(Mode::damped_stop, Cause::fallback_spent);
  ASSERT_TRUE(incident);
  EXPECT_EQ(
      incident->detail.find("the fallback policy stand's targets were out of range in more than 25 % of the window"),
      0U)
      << incident->detail;
}

TEST_F(ImuIncident, SaysHowTheImuWasLost) {
  EXPECT_EQ(detail_of(Cause::imu_lost),
            "sensor torso: its newest sample is 50 ms old, or says the same as all before it");
  record.header.imu_verdict = ImuVerdict::not_unit;
  EXPECT_EQ(detail_of(Cause::imu_lost), "sensor torso: its quaternion is no unit quaternion");
  record.header.imu_verdict = ImuVerdict::contradicts;
  EXPECT_EQ(detail_of(Cause::imu_lost),
            "sensor torso: its rotation turns otherwise than its angular velocity says (imu.contradiction)");
}

struct DegradedIncident : IncidentTest {};

TEST_F(DegradedIncident, SaysThatItsTimeIsOver) {
  robot.degraded.longest = seconds(3);
  watch = incident::IncidentWatch(robot);
  enter(Mode::tracking, Cause::drives_enabled);
  record.header.seats[Seat::policy].freshness = Freshness::missing;
  enter(Mode::degraded, Cause::command_late);
  stay(10);
  const auto incident = enter(Mode::damped_stop, Cause::degraded_spent);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->detail,
            "the robot has been degraded for 3 s (degraded.for), and the contract is not restored: none is left");
}

struct FollowingIncident : IncidentTest {};

TEST_F(FollowingIncident, NamesTheJointAndTheDistance) {
  robot.joints[2].limits.following_error = 0.2;
  watch = incident::IncidentWatch(robot);
  enter(Mode::tracking, Cause::drives_enabled);
  record.joints[2].behind = 1;
  record.joints[2].q_reference = 0.75F;
  record.joints[2].q_estimate = 0.5F;
  const auto incident = enter(Mode::damped_stop, Cause::following_lost);
  ASSERT_TRUE(incident);
  EXPECT_EQ(incident->where, "joint elbow");
  EXPECT_NE(
      incident->sentence.find("0.250 rad from its reference, more than limits.following_error (0.200 rad), for 500 ms"),
      std::string::npos)
      << incident->sentence;
}

}  // namespace
}  // namespace takt
